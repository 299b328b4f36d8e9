"""The verdict on bodies that overlap, on bumps, and on batteries."""

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from patrol.exchange import Reply
from patrol.pose import Velocity
from tests.worldsim.checks.judged import Result, checks, move, result_of, summary_of
from tests.worldsim.conftest import Lab
from worldsim.checks.bodies import BumpsRare
from worldsim.kernels.verdict import first_overlap
from worldsim.run_record import MemoryJournal


@pytest.mark.parametrize("seed", range(20))
def test_the_first_pair_is_the_one_that_a_look_at_every_pair_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    places, radii = rng.uniform(0.0, 30.0, (40, 2)), rng.uniform(0.1, 1.5, 40)
    pairs = itertools.combinations(range(40), 2)
    overlap = [(i, j) for i, j in pairs if math.dist(places[i], places[j]) < radii[i] + radii[j] - 1e-6]
    assert first_overlap(places, radii, np.argsort(places[:, 0]), 1e-6) == min(overlap, default=(40, 40))


def test_bodies_that_touch_do_not_overlap_and_none_is_no_pair() -> None:
    assert first_overlap(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([0.5, 0.5]), np.arange(2), 0.0) == (2, 2)
    assert first_overlap(np.zeros((0, 2)), np.zeros(0), np.arange(0), 0.0) == (0, 0)


@pytest.mark.parametrize(("bumps", "warned"), [(4, False), (5, True), (6, True)])
def test_robots_that_bump_more_than_once_in_two_minutes_are_named(lab: Lab, bumps: int, warned: bool) -> None:
    world = lab.patrol(ticks=12)
    whole = lab.run(world)
    journal = MemoryJournal(whole.header)
    for record in whole.ticks:
        bumped = 2 if record.k < bumps else 0
        rows = tuple(replace(row, bumped=row.number == bumped) for row in record.robots)
        journal.write(replace(record, robots=rows))
    result = result_of(BumpsRare, world.prepared, journal)
    assert result.ok
    line = f"robots bumped often, so that moves were cancelled: r2 {10 * bumps}.0 a minute, {bumps} times in all"
    assert result.warnings == ((line,) if warned else ())


# --- batteries -------------------------------------------------------------------------------------------------------

BATTERY = {"capacity": 0.01, "idle": 2.0, "drive": 1.0, "charge": 40.0}
"""36 J."""
PLAIN = {"model": "holonomic", "radius": 0.4}
DISC = {**PLAIN, "battery": BATTERY}


def drained(lab: Lab, **more: Any) -> Result:
    """A run of a robot with a small battery, and of one without any, driving at random."""
    world = lab.world([DISC, PLAIN], [(3.0, 3.0, 0.0), (14.0, 4.0, 0.0)], duration=20.0, **more)
    return world, lab.run(world)


def last_drive(journal: MemoryJournal) -> int:
    """The last tick in which r1 drives."""
    return max(record.k for record in journal.ticks if record.robots[0].c0 or record.robots[0].c1)


def test_an_empty_battery_is_named_and_its_robot_stands(lab: Lab) -> None:
    world, journal = drained(lab)
    check, last = checks((world, journal))["batteries"], last_drive(journal)
    assert check.ok
    assert 0 < last < 30
    assert check.warnings == (f"the battery of r1 was empty at tick {last} ({0.5 * last:g} s)",)
    assert any(record.robots[1].c0 for record in list(journal.ticks)[last + 1 :])
    figures = summary_of((world, journal)).robots
    assert figures["r2"].battery is None
    battery = figures["r1"].battery
    assert battery is not None
    assert (battery.empty_s, battery.least_share, battery.charges) == (0.5 * last, 0.0, 0)


def test_a_robot_that_drives_with_an_empty_battery_fails_the_run(lab: Lab) -> None:
    result = drained(lab)
    late = last_drive(result[1]) + 3
    move(result[1], late, 1, c0=1.0)
    check = checks(result)["batteries"]
    assert (check.ok, check.detail) == (False, f"r1 drives at tick {late} although its battery is empty")


def test_a_robot_that_restarts_between_two_ticks_keeps_its_charge(lab: Lab) -> None:
    world, journal = drained(lab, faults=[{"kind": "restart", "at": 16.0, "who": "r1"}])
    assert [event.kind for event in journal.events if event.robot == 1 and event.k == 32] == ["dead", "alive"]
    assert checks((world, journal))["batteries"].ok
    assert last_drive(journal) < 32


def test_the_world_tells_a_robot_its_charge_and_charges_it_at_a_dock(lab: Lab) -> None:
    world = lab.world([DISC], [(3.0, 3.0, 0.0)], duration=4.0, docks=[{"place": [4.0, 3.0], "radius": 0.5}])
    shares = []
    for k in range(8):
        shares.append(world.begin_tick()[1].charge)
        world.exchange({1: ()})
        world.end_tick({1: Reply(Velocity(1.0 if k < 2 else 0.0, 0.0), "charging", None, 0.0, 0)})
    assert shares[2] is not None
    assert shares[0] == 1.0 == shares[-1]
    assert shares[2] < 0.95
