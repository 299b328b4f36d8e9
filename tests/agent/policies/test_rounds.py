"""On the round: the ground is kept as fresh as the tour promises, and a death is made up for."""

from pathlib import Path

import numpy as np
import pytest

from agent.policies.choice import FreeChoice
from fogwatch.inprocess import run_in_process
from patrol.pose import Pose
from patrol.scenario import load_scenario, open_scenario
from tests.present import present
from tests.random_building import Building
from worldsim.world import World

ROUND = {"robots.count": 3, "robots.model": "holonomic", "point": 1.0, "duration": 400, "sensor.range": 20}
ROUND |= {"patrol.policy": "committed"}
BASE = {"radius": 0.3, "speed": 1.0, "turning_radius": 1.0}
CORNER = Pose(2.0, 2.0, 0.0)


def mfow_by_tour(terrain: str = "yards", **changes: object) -> list[float]:
    """The MFoW after each tick of a run, in terms of what the best tour promises."""
    scenario = open_scenario(terrain, {**ROUND, **changes})
    ticks: list[float] = []
    outcome = run_in_process(scenario, progress=lambda record: ticks.append(record.mfow * scenario.step))
    assert outcome.verdict.outcome == "valid"
    tour = present(outcome.summary.best_tour_s)
    return [mfow / tour for mfow in ticks]


def test_the_fog_stays_as_fresh_as_the_tour_promises() -> None:
    late = mfow_by_tour()[200:]
    assert np.mean(late) < 1.1
    assert max(late) < 1.25


def test_vertices_are_seen_as_often_by_a_sensor_that_sees_less_far_than_a_stride() -> None:
    places = [[10, 10], [50, 10], [90, 10], [90, 78], [50, 78], [10, 78]]
    graph = {"vertices": places, "edges": [[a, (a + 1) % 6, 40] for a in range(6)]}
    facts = {"terrain.graph": graph, "terrain.patrolled": "vertices", "sensor.range": 1.2}
    assert np.mean(mfow_by_tour("open", **facts)[400:]) < 1.1


def test_the_gaps_close_within_two_tours_after_a_death() -> None:
    ratios = mfow_by_tour(faults=[{"kind": "kill", "who": "r2", "at": 150, "wreck": "removed"}], duration=700)
    # Two robots are left: their promise is half as good again.
    assert np.mean(ratios[-300:]) < 1.15 * 1.5


def test_a_robot_that_died_on_the_round_blocks_no_patrol(tmp_path: Path) -> None:
    """Two rooms, the first with five walls in it, a corridor of a body's width, and in it a robot that dies at once."""
    free = np.zeros((70, 220), dtype=np.bool_)
    free[5:65, 5:65] = free[5:65, 155:215] = free[31:39, 65:155] = True
    for col in range(10, 60, 10):
        free[5:45, col : col + 2] = False
    robots = [{**BASE, "model": "holonomic", "start": start} for start in ([11.0, 3.5], [2.0, 5.5], [4.0, 5.5])]
    facts = {"terrain": {"map": str(Building(free, 0.1).write(tmp_path))}, "point": 0.1, "duration": 200}
    faults = [{"kind": "kill", "who": "r1", "at": 1.0}]
    scenario = load_scenario({**facts, "robots": robots, "faults": faults, "patrol": {"policy": "committed"}})
    ages_s: list[float] = []

    def look(world: World, _minds: object) -> None:
        last_seen = world.truth.fog.last_seen[:, :65][free[:, :65]]
        ages_s.append((world.tick - last_seen.min()) * scenario.step)

    run_in_process(scenario, look=look)
    assert max(ages_s[200:]) < 60.0


@pytest.mark.parametrize(
    ("kind", "free"),
    [
        ({"sensor.angle": 120, "robots": [{"model": "car"}, {"model": "car"}]}, True),
        ({"sensor.angle": 120}, False),
        ({"sensor.quality": 0.5}, True),
        ({"robots": [{"speed": 4.4}, {"speed": 4.4}]}, False),
        ({"robots": [{"speed": 4.4}, {"speed": 2.2}]}, False),
    ],
    ids=["cars", "sector", "poor", "equal", "speeds"],
)
def test_robots_choose_freely_where_no_tour_is_seen(kind: dict[str, object], free: bool) -> None:
    scenario = open_scenario("yards", {**ROUND, "duration": 5, **kind})

    def look(_world: object, by_number: object) -> None:
        minds = by_number.values()  # type: ignore[attr-defined]
        assert {isinstance(mind.policy.otherwise.choice, FreeChoice) for mind in minds} == {free}

    run_in_process(scenario, look=look)
