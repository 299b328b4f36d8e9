"""The check of bumps names robots whose moves are cancelled often, and fails no run."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.worldsim.checks.judged import result_of
from tests.worldsim.conftest import Lab
from worldsim.checks.bodies import BumpsRare
from worldsim.run_record import MemoryJournal


@pytest.mark.parametrize(("bumps", "warned"), [(4, False), (6, True)])
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
    line = "robots bumped often, so that moves were cancelled: r2 60.0 a minute, 6 times in all"
    assert result.warnings == ((line,) if warned else ())
