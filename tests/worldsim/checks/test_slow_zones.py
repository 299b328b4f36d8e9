"""The verdict's check of slow zones."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest

from tests.worldsim.checks.test_keep_outs import mask_of_stairs
from worldsim.verdict.judge import judge

if TYPE_CHECKING:
    from pathlib import Path

    from tests.worldsim.conftest import Lab
    from worldsim.run_record import MemoryJournal
    from worldsim.world import World

DISC = {"model": "holonomic", "radius": 0.4, "speed": 4.0}
WARD = [[16.0, 10.0], [18.0, 10.0], [18.0, 13.0], [16.0, 13.0]]


def failed(world: World, journal: MemoryJournal) -> dict[str, str]:
    return {check.name: check.detail for check in judge(journal, {}, world.prepared).failed}


def moved(journal: MemoryJournal, k: int, x: float, to_x: float) -> None:
    """Put the only robot at a place in tick k, and at another from the next tick on."""
    for tick in range(k, len(journal.records)):
        record = journal.records[tick]
        row = replace(record.robots[0], x=x if tick == k else to_x, y=11.5)
        journal.records[tick] = replace(record, robots=(row,))


@pytest.mark.parametrize("kind", ["polygon", "mask"])
@pytest.mark.parametrize(
    ("x", "way_m", "caught"),
    [(16.1, 0.2, True), (16.1, 0.15, False), (17.9, 1.5, True), (15.9, 1.5, False), (18.1, -1.5, False)],
)
def test_a_robot_that_gets_too_far_in_a_step_is_caught(
    lab: Lab, kind: str, x: float, way_m: float, caught: bool, tmp_path: Path
) -> None:
    zone: dict[str, Any] = {"name": "ward", "speed": 0.3}
    zone |= {"mask": mask_of_stairs(tmp_path)} if kind == "mask" else {"polygon": WARD}
    world = lab.world([DISC], [(3.0, 3.0, 0.0)], duration=6.0, zones=[zone])
    journal = lab.run(world)
    assert "slow zones" not in failed(world, journal)
    moved(journal, 5, x, x + way_m)
    detail = failed(world, journal).get("slow zones", "")
    assert bool(detail) == caught
    if caught:
        told = f"r1 drives {way_m / 0.5:.3f} m/s in ward, which allows 0.3 m/s, at tick 5, at ({x:.3f}, 11.500)"
        assert detail.startswith(told)


@pytest.mark.parametrize(("k", "caught"), [(3, False), (4, True), (7, True), (8, False)])
def test_only_while_the_zone_is_in_force(lab: Lab, k: int, caught: bool) -> None:
    zone = {"name": "ward", "polygon": WARD, "speed": 0.3, "times": [[2.0, 4.0]]}
    world = lab.world([DISC], [(3.0, 3.0, 0.0)], duration=6.0, zones=[zone])
    journal = lab.run(world)
    moved(journal, k, 16.5, 17.5)
    assert ("slow zones" in failed(world, journal)) == caught


def test_robots_of_all_models_that_drive_at_random_are_slow_there(lab: Lab) -> None:
    """Each of them is faster elsewhere."""
    whole = [[0.0, 0.0], [20.0, 0.0], [20.0, 15.0], [0.0, 15.0]]
    zone = {"name": "ward", "polygon": whole, "speed": 0.5, "times": [[10.0, 20.0]]}
    world = lab.patrol(60, zones=[zone])
    journal = lab.run(world)
    verdict = judge(journal, {}, world.prepared)
    assert verdict.valid, verdict.failed
    (kept,) = (check for check in verdict.checks if check.name == "slow zones")
    assert kept.detail == "80 steps in 1 slow zones, none too fast"
    fastest = {True: 0.0, False: 0.0}
    for k, record in enumerate(journal.ticks):
        for row, spec in zip(record.robots, world.scenario.roster, strict=True):
            speed = abs(row.c0) if spec.model != "holonomic" else (row.c0**2 + row.c1**2) ** 0.5
            fastest[20 <= k < 40] = max(fastest[20 <= k < 40], speed)
    assert fastest[True] == pytest.approx(0.5)
    assert fastest[False] > 2.0


def test_under_uneven_motion_the_command_counts(lab: Lab) -> None:
    zone = {"name": "ward", "polygon": [[0, 0], [20, 0], [20, 15], [0, 15]], "speed": 0.5}
    world = lab.patrol(60, zones=[zone], faults=[{"kind": "motion", "who": "all", "speed": 0.3}])
    journal = lab.run(world)
    verdict = judge(journal, {}, world.prepared)
    assert verdict.valid, verdict.failed
    record = journal.records[9]
    fast = replace(record.robots[0], c0=1.0)
    journal.records[9] = replace(record, robots=(fast, *record.robots[1:]))
    assert failed(world, journal)["slow zones"].startswith("r1 drives 1.000 m/s in ward, which allows 0.5 m/s, at tick")


def test_without_slow_zones_there_is_no_such_check(lab: Lab) -> None:
    world = lab.world([DISC], [(3.0, 3.0, 0.0)], duration=2.0)
    assert "slow zones" not in {check.name for check in judge(lab.run(world), {}, world.prepared).checks}
