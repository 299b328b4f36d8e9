"""How long a record of a journal takes to decode, and a robot's row in it, checked or not: reports read millions."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from patrol.journal import RobotTick, Status, TickRecord, pack
from patrol.journal.decode import _robot, decode

pytestmark = pytest.mark.bench

ROW: Any = (1, int(Status.ALIVE), 1.5, 2.5, 0.3, 1.0, 0.1, False, "patrolling", (1.0, 2.0), 1.5, 0, False)
ROBOTS = 5


def test_a_row_with_its_checks(benchmark: Any) -> None:
    assert benchmark(_robot, ROW) == RobotTick(*ROW)


def test_a_row_by_the_frozen_constructor_without_checks(benchmark: Any) -> None:
    benchmark(RobotTick, *ROW)


def test_a_tick(benchmark: Any) -> None:
    robots = tuple(replace(RobotTick(*ROW), number=number) for number in range(1, ROBOTS + 1))
    links = tuple((source, to, 3) for source in range(1, ROBOTS + 1) for to in range(1, ROBOTS + 1) if to != source)
    frames = tuple((number, bytes(20)) for number in range(1, ROBOTS + 1))
    payload = pack(TickRecord(3, robots, frames, links, (), 9, 1.5, 100))
    assert benchmark(decode, payload, ROBOTS).robots == robots
