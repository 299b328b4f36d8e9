"""The verdict on batteries: an empty one is named, its robot stands, and the charge is recomputed from the poses."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from patrol.exchange import Reply
from patrol.pose import Velocity
from worldsim.checks.check import CheckResult
from worldsim.output.summary import summarise
from worldsim.verdict.judge import judge

if TYPE_CHECKING:
    from tests.worldsim.conftest import Lab
    from worldsim.run_record import MemoryJournal
    from worldsim.world import World

BATTERY = {"capacity": 0.01, "idle": 2.0, "drive": 1.0, "charge": 40.0}
"""36 J."""
DISC = {"model": "holonomic", "radius": 0.4, "battery": BATTERY}
STARTS = [(3.0, 3.0, 0.0), (14.0, 4.0, 0.0)]


def drained(lab: Lab, **more: Any) -> tuple[World, MemoryJournal]:
    """A run of a robot with a small battery, and of one without any, driving at random."""
    robots = [DISC, {key: value for key, value in DISC.items() if key != "battery"}]
    world = lab.world(robots, STARTS, duration=20.0, **more)
    return world, lab.run(world)


def check_of(world: World, journal: MemoryJournal) -> CheckResult:
    return next(check for check in judge(journal, {}, world.prepared).checks if check.name == "batteries")


def test_an_empty_battery_is_named_and_its_robot_stands(lab: Lab) -> None:
    world, journal = drained(lab)
    check = check_of(world, journal)
    rows = [record.robots[0] for record in journal.ticks]
    last = max(row_k for row_k, row in enumerate(rows) if row.c0 or row.c1)
    assert check.ok
    assert 0 < last < 30
    assert check.warnings == (f"the battery of r1 was empty at tick {last} ({0.5 * last:g} s)",)
    assert any(record.robots[1].c0 for record in list(journal.ticks)[last + 1 :])
    figures = summarise(journal, judge(journal, {}, world.prepared)).robots
    assert figures["r2"].battery is None
    battery = figures["r1"].battery
    assert battery is not None
    assert (battery.empty_s, battery.least_share, battery.charges) == (0.5 * last, 0.0, 0)


def test_a_robot_that_drives_with_an_empty_battery_fails_the_run(lab: Lab) -> None:
    world, journal = drained(lab)
    rows = [record.robots[0] for record in journal.ticks]
    late = max(row_k for row_k, row in enumerate(rows) if row.c0 or row.c1) + 3
    record = journal.records[late]
    journal.records[late] = replace(record, robots=(replace(rows[late], c0=1.0), record.robots[1]))
    assert not check_of(world, journal).ok
    assert check_of(world, journal).detail == f"r1 drives at tick {late} although its battery is empty"


def test_a_robot_that_restarts_between_two_ticks_keeps_its_charge(lab: Lab) -> None:
    world, journal = drained(lab, faults=[{"kind": "restart", "at": 16.0, "who": "r1"}])
    assert [event.kind for event in journal.events if event.robot == 1 and event.k == 32] == ["dead", "alive"]
    assert check_of(world, journal).ok
    rows = [record.robots[0] for record in journal.ticks]
    assert not any(row.c0 or row.c1 for row in rows[32:])


def test_the_world_tells_a_robot_its_charge_and_charges_it_at_a_dock(lab: Lab) -> None:
    world = lab.world([DISC], [(3.0, 3.0, 0.0)], duration=4.0, docks=[{"place": [4.0, 3.0], "radius": 0.5}])
    shares = []
    for k in range(8):
        sensed = world.begin_tick()
        shares.append(sensed[1].charge)
        world.exchange({1: ()})
        world.end_tick({1: Reply(Velocity(1.0 if k < 2 else 0.0, 0.0), "charging", None, 0.0, 0)})
    assert shares[0] == 1.0
    assert shares[2] is not None
    assert shares[2] < 0.95
    assert shares[-1] == 1.0


def test_a_run_without_batteries_has_no_such_check(lab: Lab) -> None:
    world = lab.patrol(ticks=4)
    assert "batteries" not in {check.name for check in judge(lab.run(world), {}, world.prepared).checks}
