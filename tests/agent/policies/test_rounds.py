"""On the round: the ground is kept as fresh as the tour promises, evenly spaced, and a death is made up for."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from agent.policies.committed import Committed, OnRound
from agent.policies.pursuit import NO_NEARER_S
from agent.policies.surround import Surround
from experiments.random_building import Building
from fogwatch.inprocess import run_in_process
from patrol.pose import MODELS, Pose
from patrol.scenario import load_scenario, open_scenario
from tests.agent.minds import STEP
from tests.agent.plans import POINT, Robots, prepared_in, two_rooms
from worldsim.world import World

ROUND = {
    "robots.count": 3,
    "robots.model": "holonomic",
    "point": 1.0,
    "duration": 400,
    "sensor.range": 20,
    "patrol.policy": "committed",
}


BASE = {"radius": 0.3, "speed": 1.0}
CORNER = Pose(2.0, 2.0, 0.0)


def policy_of(robots: Robots) -> Committed:
    """The policy of the first robot."""
    surround = robots.minds[0].policy
    assert isinstance(surround, Surround)
    policy = surround.otherwise
    assert isinstance(policy, Committed)
    return policy


def mfow_s(**changes: object) -> list[float]:
    """The MFoW after each tick of a run on `yards`, s."""
    scenario = open_scenario("yards", {**ROUND, **changes})
    ticks: list[float] = []
    outcome = run_in_process(scenario, progress=lambda record: ticks.append(record.mfow * scenario.step))
    assert outcome.verdict.outcome == "valid"
    tour = outcome.summary.best_tour_s
    assert tour is not None
    return [mfow / tour for mfow in ticks]


def test_the_fog_stays_as_fresh_as_the_tour_promises() -> None:
    late = mfow_s()[200:]
    assert np.mean(late) < 1.1
    assert max(late) < 1.25


def test_vertices_are_seen_as_often_by_a_sensor_that_sees_less_far_than_a_stride() -> None:
    places = [[10, 10], [50, 10], [90, 10], [90, 78], [50, 78], [10, 78]]
    graph = {"vertices": places, "edges": [[a, (a + 1) % 6, 40] for a in range(6)]}
    scenario = open_scenario(
        "open", {**ROUND, "terrain.graph": graph, "terrain.patrolled": "vertices", "sensor.range": 1.2}
    )
    ticks: list[float] = []
    outcome = run_in_process(scenario, progress=lambda record: ticks.append(record.mfow * scenario.step))
    assert outcome.summary.best_tour_s is not None
    assert np.mean(ticks[400:]) < 1.1 * outcome.summary.best_tour_s


def test_the_gaps_close_within_two_tours_after_a_death() -> None:
    ratios = mfow_s(faults=[{"kind": "kill", "who": "r2", "at": 150, "wreck": "removed"}], duration=700)
    # Two robots are left: their promise is half as good again.
    assert np.mean(ratios[-300:]) < 1.15 * 1.5


def test_a_robot_that_died_on_the_round_blocks_no_patrol(tmp_path: Path) -> None:
    """Two rooms, the first with five walls in it, a corridor of a body's width, and in it a robot that dies at once."""
    free = np.zeros((70, 220), dtype=np.bool_)
    free[5:65, 5:65] = free[5:65, 155:215] = free[31:39, 65:155] = True
    for col in range(10, 60, 10):
        free[5:45, col : col + 2] = False
    robots = {"model": "holonomic", "radius": 0.3, "speed": 1.0}
    starts = [[11.0, 3.5], [2.0, 5.5], [4.0, 5.5]]
    scenario = load_scenario(
        {
            "terrain": {"map": str(Building(free, 0.1).write(tmp_path))},
            "point": 0.1,
            "duration": 200,
            "robots": [{**robots, "start": start} for start in starts],
            "faults": [{"kind": "kill", "who": "r1", "at": 1.0}],
            "patrol": {"policy": "committed"},
        }
    )
    ages_s: list[float] = []

    def look(world: World, _minds: object) -> None:
        last_seen = world.truth.fog.last_seen[:, :65][free[:, :65]]
        ages_s.append((world.tick - last_seen.min()) * scenario.step)

    run_in_process(scenario, look=look)
    assert max(ages_s[200:]) < 60.0


@pytest.mark.parametrize("kind", [{"sensor.angle": 120}, {"sensor.quality": 0.5}])
def test_a_sensor_that_shows_no_tour_leaves_every_choice_free(kind: dict[str, object]) -> None:
    scenario = open_scenario("yards", {**ROUND, **kind, "duration": 5})

    def look(_world: object, by_number: object) -> None:
        assert all(mind.policy.otherwise.on_round is None for mind in by_number.values())  # type: ignore[attr-defined]

    run_in_process(scenario, look=look)


@pytest.mark.parametrize(("second", "free"), [(4.4, False), (2.2, True)])
def test_robots_of_several_speeds_choose_freely(second: float, free: bool) -> None:
    scenario = open_scenario("yards", {**ROUND, "duration": 2, "robots": [{"speed": 4.4}, {"speed": second}]})

    def look(_world: object, by_number: object) -> None:
        minds = by_number.values()  # type: ignore[attr-defined]
        assert {mind.policy.otherwise.on_round is None for mind in minds} == {free}

    run_in_process(scenario, look=look)


@pytest.mark.parametrize("model", MODELS)
def test_a_robot_drives_on_along_the_round_while_others_see_everything(model: str) -> None:
    robots = {**BASE, "model": model, **({"turning_radius": 1.0} if model == "car" else {})}
    prepared = prepared_in(two_rooms(), [CORNER], robots, patrol={"policy": "committed"})
    one = Robots(prepared)
    fog, moved = one.minds[0].belief.fog, []
    for _ in range(200):
        before = one.bodies[0].pose
        one.tick()
        fog.last_seen[prepared.patrolled] = one.k
        moved.append(one.apart((before.x, before.y)) > 0.0)
    assert policy_of(one).on_round is not None
    halts = [len(list(run)) for drives, run in itertools.groupby(moved) if not drives]
    assert max(halts, default=0) <= 5


def test_a_robot_keeps_its_place_on_the_round_while_the_way_ahead_is_blocked_for_a_short_time() -> None:
    prepared = prepared_in(
        two_rooms(), [CORNER], {**BASE, "model": "holonomic"}, patrol={"policy": "committed"}, sensor={"range": 3.0}
    )
    robots = Robots(prepared)
    policy, mind = policy_of(robots), robots.minds[0]
    assert isinstance(policy.on_round, OnRound)
    ahead = policy.on_round.ahead

    def leaves_the_room() -> bool:
        target = policy.pursuit.target
        return target is not None and target.stand[1] * POINT > 9.6 and robots.bodies[0].pose.x < 9.0

    robots.until(leaves_the_room, 100)
    place = ahead.cursor
    assert place is not None
    mind.body.obstacles = lambda *_: [(11.0, 4.0, 1.5)]  # type: ignore[method-assign]
    for _ in range(round(NO_NEARER_S / STEP)):
        robots.tick()
        target = policy.pursuit.target
        # Meanwhile it looks at its own room.
        assert target is None or target.stand[1] * POINT < 9.6
        assert ahead.cursor == place
    robots.until(lambda: ahead.cursor != place, 100)
