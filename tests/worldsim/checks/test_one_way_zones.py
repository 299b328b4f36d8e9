"""The verdict's check of one-way zones."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest

from tests.worldsim.checks.test_keep_outs import mask_of_stairs
from worldsim.verdict.judge import judge

if TYPE_CHECKING:
    from pathlib import Path

    from tests.worldsim.conftest import Lab
    from worldsim.checks.check import CheckResult
    from worldsim.run_record import MemoryJournal
    from worldsim.world import World

DISC = {"model": "holonomic", "radius": 0.1, "speed": 0.4}
"""It may get 0.4 m back: its diameter and a step of 0.2 m."""

AISLE = [[16.0, 10.0], [18.0, 10.0], [18.0, 13.0], [16.0, 13.0]]


def checked(world: World, journal: MemoryJournal) -> CheckResult:
    (check,) = (check for check in judge(journal, {}, world.prepared).checks if check.name == "one-way zones")
    return check


def moved(journal: MemoryJournal, places: list[tuple[float, float]]) -> None:
    """Put the only robot at places from tick 5 on, one a tick."""
    for index, (x, y) in enumerate(places):
        record = journal.records[5 + index]
        journal.records[5 + index] = replace(record, robots=(replace(record.robots[0], x=x, y=y),))


@pytest.mark.parametrize("kind", ["polygon", "mask"])
@pytest.mark.parametrize(
    ("places", "back_m"),
    [
        ([(16.5, 11.0), (16.9, 11.0), (17.9, 11.0), (18.5, 11.0)], 0.0),  # with it
        ([(17.9, 11.0), (17.55, 11.0), (18.2, 11.0)], 0.35),  # a little way in, and out again
        ([(17.9, 11.0), (17.7, 11.0), (16.6, 11.0)], None),  # step by step
        ([(17.0, 10.5), (16.9, 12.9)], 0.1),  # across
        ([(16.5, 11.0), (17.5, 11.0), (16.3, 11.0)], 0.2),  # back to where it came in
        ([(17.9, 11.0), (18.1, 11.0), (17.55, 11.0), (17.2, 11.0)], 0.35),  # two visits
        ([(15.0, 11.0), (14.0, 11.0)], 0.0),  # elsewhere
    ],
)
def test_how_far_a_robot_gets_against_a_zone(
    lab: Lab, kind: str, places: list[tuple[float, float]], back_m: float | None, tmp_path: Path
) -> None:
    zone: dict[str, Any] = {"name": "aisle", "one_way": 0}
    zone |= {"mask": mask_of_stairs(tmp_path)} if kind == "mask" else {"polygon": AISLE}
    world = lab.world([DISC], [(3.0, 3.0, 0.0)], duration=6.0, zones=[zone])
    journal = lab.run(world)
    moved(journal, places)
    check = checked(world, journal)
    assert check.ok == (back_m is not None)
    if back_m is not None:
        assert check.detail.endswith(f"one-way zones, at most {back_m:.2f} m against them")
    else:
        went = "r1 went 1.300 m against aisle, where 1.107 m are allowed, by tick 7, at (16.600, 11.000)"
        assert check.detail == went


@pytest.mark.parametrize(("one_way", "back_m"), [(90, 0.0), (270, 0.2), (315, 0.14), (180, 0.0)])
def test_each_direction_counts_along_itself(lab: Lab, one_way: int, back_m: float) -> None:
    zone = {"name": "aisle", "polygon": AISLE, "one_way": one_way}
    world = lab.world([DISC], [(3.0, 3.0, 0.0)], duration=6.0, zones=[zone])
    journal = lab.run(world)
    moved(journal, [(17.0, 11.0), (17.0, 11.2), (3.0, 3.0)])
    assert checked(world, journal).detail == f"1 visits to 1 one-way zones, at most {back_m:.2f} m against them"


@pytest.mark.parametrize(
    ("until", "detail"), [(2.0, ""), (9.0, "not judged: drift or motion faults acted on robots in")]
)
def test_where_a_fault_moves_the_robot_nothing_is_judged(lab: Lab, until: float, detail: str) -> None:
    zone = {"name": "aisle", "polygon": AISLE, "one_way": 0}
    fault = {"kind": "motion", "who": "all", "speed": 0.3, "at": 1, "for": until - 1.0}
    world = lab.world([DISC], [(3.0, 3.0, 0.0)], duration=6.0, zones=[zone], faults=[fault])
    journal = lab.run(world)
    moved(journal, [(17.9, 11.0), (16.6, 11.0), (3.0, 3.0)])
    check = checked(world, journal)
    assert check.judged == (not detail)
    assert check.ok == bool(detail)
    assert check.detail.startswith(detail or "r1 went 1.300 m against aisle")


def test_without_one_way_zones_there_is_no_such_check(lab: Lab) -> None:
    world = lab.world([DISC], [(3.0, 3.0, 0.0)], duration=2.0)
    assert "one-way zones" not in {check.name for check in judge(lab.run(world), {}, world.prepared).checks}
