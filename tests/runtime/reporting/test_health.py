import json
import math
import threading
from typing import Any

import pytest

from runtime.reporting.health import HealthLines, HealthReading, facts_of, health_line
from runtime.reporting.logs import Log
from runtime.reporting.vitals import (
    COMMANDS,
    CONNECTIONS,
    DECISION,
    DROPPED,
    MEMORY,
    MFOW,
    ODOMETRY_AGE,
    PAGES,
    PEERS,
    QUEUE,
    REFUSED,
    ROBOTS,
    ROUTER_SILENT,
    SINCE_TICK,
    STOPPED,
    TICK,
    UNUSABLE,
    Figure,
    Value,
    Vitals,
)


def test_a_robots_line() -> None:
    figures: dict[Figure, Value] = {
        TICK: 120,
        SINCE_TICK: 0.24,
        MFOW: 61.0,
        PEERS: 2,
        REFUSED: {"old": 3, "tag": 0, "ahead": 1},
        DROPPED: {},
        QUEUE: 4,
        DECISION: 0.0213,
        MEMORY: 212_400_000,
    }
    before = HealthReading(10.0, {TICK: 100})
    assert health_line(HealthReading(12.0, figures), before) == (
        "health: tick 120, 10.0 ticks/s, last one 0.2 s ago, MFoW 61 s, peers heard: 2, frames refused: 3 old and "
        "1 ahead, messages dropped: none, messages waiting: 4, decision 21.3 ms, 212 MB"
    )


@pytest.mark.parametrize(
    ("figures", "line"),
    [
        ({TICK: 5}, "tick 5"),
        ({QUEUE: 0}, "no tick yet, messages waiting: 0"),
        ({CONNECTIONS: 5, MEMORY: 33e6}, "connections: 5, 33 MB"),
        ({ROBOTS: {"alive": 4, "dead": 1, "lost": 0}}, "robots: 4 alive and 1 dead"),
        (
            {ODOMETRY_AGE: 1.26, STOPPED: 1, UNUSABLE: {"late": 2}, ROUTER_SILENT: 3.6},
            "router silent for 4 s in all, stopped, odometry 1.3 s ago, robot's messages refused: 2 late",
        ),
        (
            {PAGES: 2, COMMANDS: {"r1": 7, "r2": 9}, STOPPED: 0},
            "may drive, commands received: 7 r1 and 9 r2, pages open: 2",
        ),
    ],
    ids=[
        *("no rate at first", "before the first tick", "a router has no ticks", "only robots that there are"),
        *("a driver", "others"),
    ],
)
def test_the_first_line(figures: dict[Figure, Value], line: str) -> None:
    assert health_line(HealthReading(1.0, figures), None) == f"health: {line}"
    if TICK in figures:
        assert health_line(HealthReading(1.0, figures), HealthReading(0.0, {})) == f"health: {line}"


def test_facts_are_json() -> None:
    facts = facts_of({MFOW: math.inf, ROBOTS: {"alive": 2, "lost": math.nan}, TICK: 3})
    assert json.loads(json.dumps(facts, allow_nan=False)) == {
        "fogwatch_mfow_seconds": None,
        "fogwatch_robots": {"alive": 2, "lost": None},
        "fogwatch_tick": 3,
    }


class Listening(Log):
    """Keeps the lines, and says when there are enough."""

    def __init__(self, enough: int) -> None:
        super().__init__("r1")
        self.lines: list[str] = []
        self.there = threading.Event()
        self._enough = enough

    def info(self, msg: object, *args: object, **facts: Any) -> None:
        assert not args
        assert set(facts) == {"health"}
        self.lines.append(str(msg))
        if len(self.lines) >= self._enough:
            self.there.set()


def test_lines_come_until_they_are_closed() -> None:
    log, vitals = Listening(2), Vitals()
    vitals.beat(4, {})
    health = HealthLines(vitals, log, 0.01)
    assert log.there.wait(300.0)
    health.close()
    assert all(line.startswith("health: tick 4") for line in log.lines)
    assert not any(thread.name == "health" for thread in threading.enumerate())


def test_the_rate_of_ticks_is_that_since_the_line_before() -> None:
    """100 ticks before the second line, and none after it."""

    class Counting(Listening):
        def info(self, msg: object, *args: object, **facts: Any) -> None:
            vitals.beat(100, {})
            super().info(msg, *args, **facts)

    log, vitals = Counting(4), Vitals()
    vitals.beat(0, {})
    health = HealthLines(vitals, log, 0.01)
    assert log.there.wait(300.0)
    health.close()
    assert "ticks/s" not in log.lines[0]
    assert " 0.0 ticks/s" not in log.lines[1]
    assert all("tick 100, 0.0 ticks/s" in line for line in log.lines[2:])
