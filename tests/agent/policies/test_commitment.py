"""Commitment: a target is kept until it has been seen, and dropped where it cannot be."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from agent.build import Shared, build_mind
from agent.policies.commitment import Commitment
from agent.policies.pursuit import GivenUp, Target
from agent.ports import Bearing, Decision, Intent, Place, State
from agent.view import View
from patrol.ground.terrain import Terrain
from patrol.pose import MODELS, Pose
from patrol.prepare import Prepared
from tests.agent.minds import STEP, at
from tests.agent.plans import POINT, Robots, plan, prepared_in, two_rooms
from tests.present import present

# Not the product's own, so that a wrong one there is noticed.
AT_HAND_S = 3.0
LEFT_OUT_S = 20.0
LONGEST_S = 960.0
MOST_PLACES = 64
NO_NEARER_S = 15.0

BASE = {"radius": 0.3, "speed": 1.0, "turning_radius": 1.0}
CORNER = Pose(2.0, 2.0, 0.0)
FREE = "agent.policies.commitment:Commitment"
CLAIMS = {"policy": FREE, "options": {"separation": "claims"}}


@pytest.fixture(autouse=True)
def _without_random_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("agent.policies.commitment.RANDOM_MOVE", 0.0)


def alone(
    terrain: Terrain, start: Pose = CORNER, model: str = "holonomic", *, sensor: Mapping[str, Any] | None = None
) -> Prepared:
    sees = {"range": 3.0, **(sensor or {})}
    return prepared_in(terrain, [start], {**BASE, "model": model}, patrol=CLAIMS, sensor=sees)


def target_of(robots: Robots, robot: int = 0) -> Target | None:
    return robots.policy(Commitment, robot).pursuit.target


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
            assert decision.state == State.PATROLLING, "a policy without a round has nothing to fall back from"
        before = target, way


def test_without_an_age_nothing_pulls() -> None:
    robots = Robots(alone(two_rooms()))
    (decision,) = robots.tick()
    assert (target_of(robots), decision.command.speed_mps) == (None, 0.0)
    robots.tick()
    assert target_of(robots) is not None


# --- giving up -------------------------------------------------------------------------------------------------------


class Held(Robots):
    """Robots that the world does not move from some tick on, as if something that they cannot know of held them."""

    held_from = 10

    def tick(self, up: Sequence[int] | None = None) -> list[Decision]:
        poses = [body.pose for body in self.bodies]
        decisions = super().tick(up)
        if self.k > self.held_from:
            for body, pose in zip(self.bodies, poses, strict=True):
                body.pose = pose
        return decisions


def test_who_comes_no_nearer_gives_up_and_leaves_the_place_out() -> None:
    robots = Held(alone(two_rooms()))
    changed = changes(robots, round(2.4 * (NO_NEARER_S + 2.0) / STEP) + robots.held_from)
    stuck = [change for change in changed if change.k > robots.held_from + 1]
    assert len(stuck) >= 2
    waits = np.diff([robots.held_from, *(change.k for change in stuck)]) * STEP
    assert (waits >= AT_HAND_S).all()
    assert (waits <= AT_HAND_S + NO_NEARER_S + 2.5).all()
    given_up = robots.policy(Commitment).pursuit.given_up.places
    assert {place[:2] for place in given_up} == {change.old.stand for change in stuck}
    spells = [(place[2] - change.k) * STEP for place, change in zip(given_up, stuck, strict=True)]
    assert spells == [LEFT_OUT_S] * len(stuck)
    # The next targets are not beside those that were given up.
    for earlier, later in itertools.pairwise(stuck):
        assert math.dist(earlier.old.point, later.old.point) * POINT > 0.6


def test_what_was_given_up_is_tried_again_where_nothing_else_is_left() -> None:
    robots = Robots(alone(two_rooms()))
    for _ in range(3):
        robots.tick()
    pursuit, target = robots.policy(Commitment).pursuit, target_of(robots)
    assert target is not None
    pursuit.given_up = GivenUp(1000.0, POINT, STEP)
    pursuit.given_up.add(robots.k, target.point)
    pursuit.target = None
    robots.tick()
    assert target_of(robots) is not None
    assert pursuit.given_up.places == []


def test_a_target_to_which_no_way_leads_any_more_is_dropped_at_once() -> None:
    robots = Robots(alone(two_rooms(), Pose(6.0, 4.0, 0.0)))
    robots.tick()
    robots.tick()
    assert target_of(robots) is not None
    # A wreck in the corridor: the target in the other room cannot be reached.
    robots.policy(Commitment).pursuit.target = Target((40, 200), (40, 200), 10)
    robots.minds[0].body.obstacles = lambda *_: [(11.0, 4.0, 1.5)]  # type: ignore[method-assign]
    robots.tick()
    now = present(target_of(robots))
    assert now.point[1] * POINT < 11.0


# --- claims ----------------------------------------------------------------------------------------------------------


def pair(separation: str = "claims", second_m: float = 18.0) -> Robots:
    """Two robots, in the first room and in the second, or side by side."""
    starts = [Pose(4.0, 4.0, 0.0), Pose(second_m, 4.0, 0.0)]
    patrol = {"policy": FREE, "options": {"separation": separation}}
    robots = {**BASE, "model": "holonomic"}
    return Robots(prepared_in(two_rooms(), starts, robots, patrol=patrol, sensor={"range": 3.0}))


def test_with_claims_two_robots_side_by_side_go_different_ways() -> None:
    """Without, they want the same places."""
    together = {}
    for separation in ("claims", "none"):
        robots, near = pair(separation, second_m=4.8), 0
        for _ in range(200):
            robots.tick()
            first, second = target_of(robots, 0), target_of(robots, 1)
            near += first is not None and second is not None and math.dist(first.point, second.point) * POINT < 1.0
        together[separation] = near
    assert together["claims"] < 20
    assert together["none"] > 2 * together["claims"] + 20


def test_a_robot_whose_own_ground_is_fresh_takes_anothers() -> None:
    robots = pair()
    for mind in robots.minds:
        mind.belief.fog.last_seen[:, :110] = 10**6  # ages below 0: nothing there pulls
    robots.k = 5
    robots.tick()
    target = present(target_of(robots, 0))
    assert target.point[1] >= 110


def test_a_small_room_is_patrolled_without_a_stop() -> None:
    room = plan((3.0, 3.0), (0.0, 0.0, 3.0, 3.0))
    robots = Robots(alone(room, Pose(1.0, 1.0, 0.0), sensor={"range": 0.6}))
    changed = changes(robots, 400)
    late = [change for change in changed if change.k * STEP > 100.0]
    assert all(change.age < 0.5 * change.old.age for change in changed)
    assert len(late) >= 25
    assert robots.policy(Commitment).pursuit.given_up.places == []


# --- sensors and places ----------------------------------------------------------------------------------------


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


@pytest.mark.parametrize(("sensor", "moves"), [({"angle": 90}, False), ({"quality": 0.5}, True)])
def test_on_its_stand_a_car_turns_to_what_it_came_to_see_or_looks_from_elsewhere(
    sensor: dict[str, Any], moves: bool
) -> None:
    """A sensor that looks all round sees the same whichever way the car faces."""
    robots = Robots(alone(two_rooms(), model="car", sensor=sensor))
    policy, there = robots.policy(Commitment), []
    decide = policy.decide

    def note(view: View) -> Intent:
        intent = decide(view)
        if isinstance(intent, Place | Bearing) and intent.figures.get("way_m") == 0.0:
            there.append(intent)
        return intent

    policy.decide = note  # type: ignore[method-assign]
    for _ in range(300):
        robots.tick()
    headed = [intent for intent in there if isinstance(intent, Place) and intent.exact and intent.heading is not None]
    assert there
    assert headed == ([] if moves else there)
    assert any(isinstance(intent, Bearing) for intent in there) is moves


def test_in_a_long_corridor_the_far_end_is_within_reach() -> None:
    corridor = plan((200.0, 2.0), (0.0, 0.0, 200.0, 2.0), point=0.5)
    robots = Robots(alone(corridor, Pose(2.0, 1.0, 0.0), sensor={"range": 5.0}))
    for _ in range(420):
        robots.tick()
    assert seen_share(robots) == 1.0
    # Back at the beginning, it is the end that pulls: ages decide, not the way alone.
    ends = [change.old.point[1] * 0.5 for change in changes(robots, 500)]
    assert min(ends) < 20.0


def test_who_is_off_the_ground_leaves_it_to_its_body() -> None:
    mind = Robots(alone(two_rooms())).minds[0]
    assert mind.step(at(3, Pose(11.0, 1.0, 0.0)), []).state == "holding"


def test_minds_that_share_working_memory_decide_as_if_they_did_not() -> None:
    together, apart = pair(), pair()
    apart.minds = [build_mind(Shared(apart.prepared), number) for number in (1, 2)]
    for _ in range(60):
        assert together.tick() == apart.tick()


# --- places that were given up ---------------------------------------------------------------------------------------


def test_a_place_that_is_given_up_again_is_left_out_for_longer_and_others_are_not() -> None:
    given_up = GivenUp(0.3, 0.1, STEP)
    spells = []
    for turn in range(2000):
        given_up.add(turn, (5, 5))
        spells.append((given_up.places[-1][2] - turn) * STEP)
    assert spells[:7] == [20.0, 40.0, 80.0, 160.0, 320.0, 640.0, 960.0]
    assert spells[-1] == LONGEST_S
    given_up.add(2000, (5, 40))
    assert [place[:2] for place in given_up.places] == [(5, 5), (5, 40)]
    assert (given_up.places[-1][2] - 2000) * STEP == LEFT_OUT_S
    for col in range(3 * MOST_PLACES):
        given_up.add(2000, (0, 50 * col))
    assert len(given_up.places) == MOST_PLACES


def test_what_lies_around_a_place_is_left_out_with_it_and_forgiven_with_it() -> None:
    given_up = GivenUp(0.3, 0.1, STEP)
    given_up.add(10, (5, 5))
    assert given_up.now(11).tolist() == [[5, 5, 36]]
    assert given_up.now(10 + round(LEFT_OUT_S / STEP) - 1).size == 3
    assert given_up.now(10 + round(LEFT_OUT_S / STEP)).size == 0
    given_up.forgive((5, 12))
    assert given_up.places != []
    given_up.forgive((5, 11))
    assert given_up.places == []


def test_a_place_is_forgotten_some_time_after_it_was_left_out() -> None:
    given_up = GivenUp(0.3, 0.1, STEP)
    given_up.add(0, (5, 5))
    late = round((LEFT_OUT_S + LONGEST_S) / STEP)
    given_up.add(late, (5, 5))
    assert given_up.places == [(5, 5, late + round(LEFT_OUT_S / STEP), round(LEFT_OUT_S / STEP))]
