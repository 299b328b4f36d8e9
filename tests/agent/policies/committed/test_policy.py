"""Commitment: a target is kept until it has been seen, and dropped where it cannot be."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from agent.build import build_mind
from agent.policies.committed.policy import (
    AT_HAND_S,
    NO_NEARER_S,
    Committed,
)
from agent.policies.committed.shunned import LONGEST_SHUNNED_S, MOST_SHUNNED, SHUNNED_S
from agent.policies.committed.target import Target
from agent.policies.surround.surround import Surround
from patrol.ground.terrain import Terrain
from patrol.pose import MODELS, Pose
from patrol.prepare import Prepared
from tests.agent.minds import STEP, at
from tests.agent.plans import POINT, Robots, plan, prepared_in

BASE = {"radius": 0.3, "speed": 1.0}
CORNER = Pose(2.0, 2.0, 0.0)
CALM = {"random_move": 0.0}


def two_rooms() -> Terrain:
    """Two rooms of 8 x 8 m, joined by a corridor of 6 m."""
    return plan((22.0, 8.0), (0.0, 0.0, 8.0, 8.0), (8.0, 3.0, 14.0, 5.0), (14.0, 0.0, 22.0, 8.0))


def alone(
    terrain: Terrain,
    start: Pose = CORNER,
    model: str = "holonomic",
    *,
    patrol: Mapping[str, Any] | None = None,
    sensor: Mapping[str, Any] | None = None,
) -> Prepared:
    robots = {**BASE, "model": model, **({"turning_radius": 1.0} if model == "car" else {})}
    sees = {"range": 3.0, **(sensor or {})}
    return prepared_in(terrain, [start], robots, patrol={**CALM, **(patrol or {})}, sensor=sees)


def policy_of(robots: Robots, robot: int = 0) -> Committed:
    """The policy of a robot."""
    surround = robots.minds[robot].policy
    assert isinstance(surround, Surround)
    policy = surround._otherwise
    assert isinstance(policy, Committed)
    return policy


def target_of(robots: Robots, robot: int = 0) -> Target | None:
    return policy_of(robots, robot)._target


def seen_share(robots: Robots) -> float:
    fog = robots.minds[0].belief.fog
    return fog.seen / fog.points


@dataclass(frozen=True)
class Change:
    """A tick at which a robot took another target, the old one and how old that was."""

    k: int
    old: Target
    age: int


def changes(robots: Robots, ticks: int) -> list[Change]:
    """The changes of the first robot's target."""
    found = []
    before = None
    for _ in range(ticks):
        robots.tick()
        now = target_of(robots)
        if before is not None and (now is None or now.point != before.point):
            last = int(robots.minds[0].belief.fog.last_seen[before.point])
            found.append(Change(robots.k - 1, before, robots.k - 1 - max(last, 0)))
        before = now
    return found


@pytest.mark.parametrize("model", MODELS)
def test_a_target_is_kept_until_it_has_been_seen(model: str) -> None:
    robots = Robots(alone(two_rooms(), model=model))
    changed = changes(robots, 700)
    assert len(changed) >= 4
    assert all(change.age < 0.5 * change.old.age for change in changed)
    assert seen_share(robots) == 1.0


def test_the_way_to_a_target_gets_shorter_at_each_step() -> None:
    robots = Robots(alone(two_rooms()))
    before = None
    for _ in range(120):
        (decision,) = robots.tick()
        target = target_of(robots)
        way = decision.figures.get("way_m", math.inf)
        if before is not None and before[0] == target:
            assert way < before[1]
        before = target, way


def test_without_an_age_nothing_pulls() -> None:
    robots = Robots(alone(two_rooms()))
    (decision,) = robots.tick()
    assert (target_of(robots), decision.command.speed_mps) == (None, 0.0)
    robots.tick()
    assert target_of(robots) is not None


def test_a_car_goes_only_as_far_as_its_target_comes_into_sight() -> None:
    robots = Robots(alone(two_rooms(), model="car"))
    for _ in range(2):
        robots.tick()
    target = target_of(robots)
    assert target is not None
    assert target.stand != target.close
    assert math.dist(target.stand, target.point) * POINT <= 3.0


@pytest.mark.parametrize("model", ["holonomic", "differential"])
def test_a_body_that_reaches_points_exactly_does_not_stop_short_of_its_target(model: str) -> None:
    robots = Robots(alone(two_rooms(), model=model))
    for _ in range(2):
        robots.tick()
    target = target_of(robots)
    assert target is not None
    assert target.stand == target.close


# --- giving up -------------------------------------------------------------------------------------------------------


class Held(Robots):
    """Robots that the world does not move from some tick on, as if something that they cannot know of held them."""

    held_from = 10

    def tick(self) -> Any:
        poses = [body.pose for body in self.bodies]
        decisions = super().tick()
        if self.k > self.held_from:
            for body, pose in zip(self.bodies, poses, strict=True):
                body.pose = pose
        return decisions


def test_who_comes_no_nearer_gives_up_and_leaves_the_place_out() -> None:
    robots = Held(alone(two_rooms()))
    changed = changes(robots, round(4.0 * (NO_NEARER_S + 2.0) / STEP) + robots.held_from)
    stuck = [change for change in changed if change.k > robots.held_from + 1]
    assert len(stuck) >= 2
    waits = np.diff([robots.held_from, *(change.k for change in stuck)]) * STEP
    assert (waits >= AT_HAND_S).all()
    assert (waits <= AT_HAND_S + NO_NEARER_S + 2.5).all()
    shunned = policy_of(robots)._shunned.places
    assert {shun[:2] for shun in shunned} == {change.old.close for change in stuck}
    spells = [(shun[2] - change.k) * STEP for shun, change in zip(shunned, stuck, strict=True)]
    assert spells == [SHUNNED_S] * len(stuck)
    # The next targets are not beside those that were given up.
    for earlier, later in itertools.pairwise(stuck):
        assert math.dist(earlier.old.point, later.old.point) * POINT > 0.6


def test_a_place_that_is_given_up_again_is_left_out_for_longer_and_others_are_not() -> None:
    commitment = policy_of(Robots(alone(two_rooms())))
    spells = []
    for turn in range(2000):
        commitment._shunned.add(turn, (5, 5))
        spells.append((commitment._shunned.places[-1][2] - turn) * STEP)
    assert spells[:6] == [60.0, 120.0, 240.0, 480.0, 960.0, 960.0]
    assert spells[-1] == LONGEST_SHUNNED_S
    commitment._shunned.add(2000, (5, 40))
    assert [one[:2] for one in commitment._shunned.places] == [(5, 5), (5, 40)]
    assert (commitment._shunned.places[-1][2] - 2000) * STEP == SHUNNED_S
    for col in range(3 * MOST_SHUNNED):
        commitment._shunned.add(2000, (0, 50 * col))
    assert len(commitment._shunned.places) == MOST_SHUNNED


def test_what_was_given_up_is_tried_again_where_nothing_else_is_left() -> None:
    robots = Robots(alone(two_rooms()))
    for _ in range(3):
        robots.tick()
    commitment, target = policy_of(robots), target_of(robots)
    assert target is not None
    commitment._shunned._around = 10**9
    commitment._shunned.add(robots.k, target.point)
    commitment._target = None
    robots.tick()
    assert target_of(robots) is not None
    assert commitment._shunned.places == []


def test_a_target_to_which_no_way_leads_any_more_is_dropped_at_once() -> None:
    robots = Robots(alone(two_rooms(), Pose(6.0, 4.0, 0.0)))
    robots.tick()
    robots.tick()
    mind = robots.minds[0]
    far = policy_of(robots)
    target = target_of(robots)
    assert target is not None
    # A wreck in the corridor: the target in the other room cannot be reached.
    far._target = Target((40, 200), (40, 190), (40, 200), 10, away=False)
    discs = [(11.0, 4.0, 1.5)]
    mind.body.obstacles = lambda *_: discs  # type: ignore[method-assign]
    robots.tick()
    now = target_of(robots)
    assert now is not None
    assert now.point[1] * POINT < 11.0


# --- claims ----------------------------------------------------------------------------------------------------------


def pair(separation: str) -> Robots:
    """One robot in each room."""
    starts = [Pose(4.0, 4.0, 0.0), Pose(18.0, 4.0, 0.0)]
    patrol = {**CALM, "separation": separation}
    robots = {**BASE, "model": "holonomic"}
    return Robots(prepared_in(two_rooms(), starts, robots, patrol=patrol, sensor={"range": 3.0}))


def test_with_claims_each_robot_sees_to_its_own_ground_first() -> None:
    robots = pair("claims")
    for _ in range(60):  # later on all of it is fresh
        robots.tick()
        for robot in (0, 1):
            target = target_of(robots, robot)
            if target is not None and not target.away:
                here, there = (robots.apart(robots.minds[0]._ground.terrain.centre(*target.point), r) for r in (0, 1))
                assert (here < there + 2.0) if robot == 0 else (there < here + 2.0)


def test_a_robot_whose_own_ground_is_fresh_takes_anothers() -> None:
    robots = pair("claims")
    for mind in robots.minds:
        mind.belief.fog.last_seen[:, :110] = 10**6  # ages below 0: nothing there pulls
    robots.k = 5
    robots.tick()
    target = target_of(robots, 0)
    assert target is not None
    assert target.point[1] >= 110


def test_a_window_that_decides_gives_the_target_that_the_whole_ground_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    rooms = [(10.0 * left, 0.0, 10.0 * left + 8.0, 8.0) for left in range(8)]
    gaps = [(10.0 * left - 2.0, 3.0, 10.0 * left, 5.0) for left in range(1, 8)]
    starts = [Pose(10.0 * room + 4.0, 4.0, 0.0) for room in range(1, 7)]
    patrol = {**CALM, "separation": "claims", "claim_width": 0.2}
    given = prepared_in(
        plan((78.0, 8.0), *rooms, *gaps, point=0.5),
        starts,
        {**BASE, "model": "holonomic"},
        patrol=patrol,
        sensor={"range": 1.5},
    )
    found = []
    for widens, measures in ((True, False), (False, False), (False, True)):
        robots, targets = Robots(given), []
        decided: list[bool] = []
        for number in range(len(starts)):
            commitment = policy_of(robots, number)
            assert commitment._widens
            commitment._widens = widens
            if not measures:
                # As while something is closed.
                monkeypatch.setattr(commitment._nearby, "claimed", lambda *_: None)
            whole = commitment._within_reach

            def counted(*what: Any, search: Any = whole, decided: list[bool] = decided) -> Target | None:
                target: Target | None = search(*what)
                decided.append(target is not None)
                return target

            monkeypatch.setattr(commitment, "_within_reach", counted)
        for _ in range(150):
            robots.tick()
            targets.append([target_of(robots, number) for number in range(len(starts))])
        found.append(targets)
        assert any(decided) == widens
    assert found[0] == found[1] == found[2]


# --- leaving a circle ------------------------------------------------------------------------------------------------


def test_who_has_stayed_in_a_circle_for_long_leaves_it() -> None:
    robots = Robots(alone(two_rooms(), Pose(4.0, 4.0, 0.0)))
    commitment = policy_of(robots)
    robots.tick()
    for tick in range(200):
        commitment._whereabouts.note(tick, (4.0, 4.0))
    commitment._target = None
    robots.tick()
    target = target_of(robots)
    assert target is not None
    assert target.away
    assert target.stand == target.close
    x, y = robots.terrain.centre(*target.stand)
    assert math.dist((x, y), (4.0, 4.0)) > commitment._whereabouts.reach
    # It goes there although the point comes into sight before.
    while robots.apart((x, y)) > 1.0:
        assert robots.k < 40
        assert commitment._whereabouts.home() is None or target_of(robots) == target
        robots.tick()


def test_a_room_that_fits_into_the_circle_is_patrolled_as_ever() -> None:
    """Who cannot leave goes from one place to the next without stopping."""
    room = plan((3.0, 3.0), (0.0, 0.0, 3.0, 3.0))
    robots = Robots(alone(room, Pose(1.0, 1.0, 0.0), sensor={"range": 0.6}))
    changed = changes(robots, 400)
    late = [change for change in changed if change.k * STEP > 100.0]
    assert all(change.age < 0.5 * change.old.age for change in changed)
    assert not any(change.old.away for change in changed)
    assert len(late) >= 25
    assert policy_of(robots)._shunned.places == []


# --- sensors, laws and places ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(
    "sensor", [{"angle": 90}, {"quality": 0.3}, {"angle": 120, "quality": [[1, 0.9], [3, 0.1]]}], ids=str
)
def test_a_narrow_or_a_poor_sensor_sees_everything_too(model: str, sensor: dict[str, Any]) -> None:
    robots = Robots(alone(plan((10.0, 6.0), (0.0, 0.0, 4.0, 6.0), (4.0, 2.0, 10.0, 4.0)), model=model, sensor=sensor))
    for _ in range(500):
        robots.tick()
    assert seen_share(robots) == 1.0
    assert robots.minds[0].belief.fog.mfow(robots.k) * STEP < 200.0


def test_looks_that_leave_some_of_the_age_count_as_progress() -> None:
    """A sensor that removes a tenth of the age needs more time than one that removes all of it."""
    robots = Robots(alone(plan((14.0, 3.0), (0.0, 0.0, 14.0, 3.0)), Pose(1.0, 1.5, 0.0), sensor={"quality": 0.1}))
    old = [change for change in changes(robots, 300) if change.old.age > 40]
    assert len(old) >= 2
    assert all(change.age < 0.5 * change.old.age for change in old)


def test_in_a_long_corridor_the_far_end_is_within_reach() -> None:
    corridor = plan((200.0, 2.0), (0.0, 0.0, 200.0, 2.0), point=0.5)
    robots = Robots(alone(corridor, Pose(2.0, 1.0, 0.0), sensor={"range": 5.0}))
    for _ in range(420):
        robots.tick()
    assert seen_share(robots) == 1.0
    # Back at the beginning, it is the end that pulls: ages decide, not the way alone.
    ends = [change.old.point[1] * 0.5 for change in changes(robots, 500)]
    assert min(ends) < 20.0


@pytest.mark.parametrize("fow", ["f1", "f2", "f3", "f4", "f5"])
@pytest.mark.parametrize("distance", ["g1", "g2", "g3", "g4", "g5"])
def test_every_law_gives_targets_whatever_the_age(fow: str, distance: str) -> None:
    law = {"fow": fow, "distance": distance}
    robots = Robots(alone(two_rooms(), patrol=law))
    with np.errstate(invalid="raise", divide="raise"):
        for _ in range(25):
            (decision,) = robots.tick()
            assert all(math.isfinite(number) for number in decision.figures.values())
        assert target_of(robots) is not None
        # Everything was seen just now, and a tick later all of it is one tick old.
        fog = robots.minds[0].belief.fog
        patrolled = fog.last_seen < 10**6
        for age in (0, 1):
            mind = Robots(alone(two_rooms(), patrol=law)).minds[0]
            mind.belief.fog.last_seen[patrolled] = np.maximum(mind.belief.fog.last_seen[patrolled], -1)
            assert mind.step(at(age, Pose(2.0, 2.0, 0.0)), []).mfow == age


@pytest.mark.parametrize("paths", ["straight", "wave"])
def test_with_every_kind_of_paths_two_rooms_are_seen(paths: str) -> None:
    robots = Robots(alone(two_rooms(), patrol={"paths": paths}))
    held = 0
    for _ in range(700):
        (decision,) = robots.tick()
        held += decision.command.speed_mps == 0.0
    assert held < 30
    assert seen_share(robots) > (0.95 if paths == "straight" else 0.999), held


def test_who_is_off_the_ground_leaves_it_to_its_body() -> None:
    mind = Robots(alone(two_rooms())).minds[0]
    assert mind.step(at(3, Pose(11.0, 1.0, 0.0)), []).state == "holding"


def test_minds_that_share_working_memory_decide_as_if_they_did_not() -> None:
    together = pair("claims")
    apart = pair("claims")
    prepared = prepared_in(
        two_rooms(),
        [body.pose for body in apart.bodies],
        {**BASE, "model": "holonomic"},
        patrol={**CALM, "separation": "claims"},
        sensor={"range": 3.0},
    )
    apart.minds = [build_mind(prepared, number) for number in (1, 2)]
    for _ in range(60):
        assert together.tick() == apart.tick()
