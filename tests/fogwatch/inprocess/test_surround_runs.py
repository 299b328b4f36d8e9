"""Whole fleets that find an intruder, stand around it, and patrol on when it is gone."""

import math
from typing import Any

import pytest

from fogwatch.inprocess import Outcome, run_in_process
from patrol.journal import TickRecord
from patrol.radio.message import decode
from patrol.scenario import load_scenario

FAR = 12.0
WIDE = 45.0
PAPERS = {"policy": "potential-field"}
"""A patrol that finds the intruder in time: a direction chosen anew at each tick, as in the paper."""


def run(terrain: str, place: tuple[float, float], seed: int, duration: float, **more: Any) -> Outcome:
    intruder = {"place": list(place), **more.pop("intruder", {})}
    robots = {"count": 5, "model": "holonomic", **more.pop("robots", {})}
    given = {"terrain": {"builtin": terrain}, "point": 0.5, "seed": seed, "duration": duration}
    outcome = run_in_process(load_scenario({**given, "robots": robots, "intruders": [intruder], **more}))
    assert outcome.verdict.valid, outcome.verdict.failed
    assert outcome.summary.messages.rejected == 0
    return outcome


def records(outcome: Outcome) -> list[TickRecord]:
    return list(outcome.journal.ticks)


def around(record: TickRecord, place: tuple[float, float]) -> tuple[float, float]:
    """The farthest robot's distance (m) and the least gap between bearings (degrees)."""
    far = max(math.dist((row.x, row.y), place) for row in record.robots)
    seen = sorted(math.degrees(math.atan2(row.y - place[1], row.x - place[0])) % 360.0 for row in record.robots)
    return far, min((b - a) % 360.0 for a, b in zip(seen, seen[1:] + seen[:1], strict=True))


@pytest.mark.parametrize(
    ("terrain", "place", "seed", "duration"),
    [
        ("open", (50.0, 40.0), 1, 60.0),
        ("open", (50.0, 40.0), 2, 60.0),
        ("open", (20.0, 70.0), 3, 60.0),
        ("site", (230.25, 127.25), 1, 130.0),
        ("site", (233.25, 36.75), 5, 100.0),
        ("site", (41.25, 126.25), 6, 150.0),
    ],
)
def test_five_robots_end_spread_around_a_still_intruder(
    terrain: str, place: tuple[float, float], seed: int, duration: float
) -> None:
    last = records(run(terrain, place, seed, duration, patrol=PAPERS))[-1]
    far, gap = around(last, place)
    assert far <= FAR
    assert gap >= WIDE
    assert {row.state for row in last.robots} == {"surrounding"}


@pytest.mark.parametrize("model", ["car", "differential"])
def test_robots_that_steer_end_around_it_too(model: str) -> None:
    place = (50.0, 40.0)
    far, gap = around(records(run("open", place, 1, 80.0, robots={"model": model}))[-1], place)
    assert far <= FAR
    assert gap >= WIDE


def test_when_it_is_gone_robots_patrol_on() -> None:
    intruder = {"at": 10.0, "for": 20.0}
    patrol = {"contact_memory": 5.0}
    outcome = run("open", (84.0, 50.0), 1, 70.0, intruder=intruder, patrol=patrol)
    ticks = records(outcome)
    busy = [record.k for record in ticks if any(row.state == "surrounding" for row in record.robots)]
    assert busy[0] >= 20
    assert busy[-1] == 59 + 10  # last seen at tick 59, remembered for 10 more
    assert all(row.state == "patrolling" for row in ticks[-1].robots)
    assert outcome.summary.seen_share > 0.5


def test_only_those_who_see_it_report_it_and_the_same_seed_repeats() -> None:
    first, again = (run("open", (50.0, 40.0), 4, 60.0) for _ in range(2))
    assert first.summary.trace_hash == again.summary.trace_hash
    reports = 0
    for record in records(first):
        poses = {row.number: (row.x, row.y) for row in record.robots}
        for source, frame in record.frames:
            position = decode(frame)
            if position.robot == 0:
                reports += 1
                assert (position.pose.x, position.pose.y) == (50.0, 40.0)
                assert math.dist(poses[source], (50.0, 40.0)) < 11.0
            else:
                assert position.robot == source
    assert reports > 0


def test_without_intruders_nothing_about_them_matters() -> None:
    given = {"terrain": {"builtin": "yards"}, "point": 0.5, "duration": 15, "robots": {"count": 3}}
    plain, other = (
        run_in_process(load_scenario({**given, "patrol": patrol}))
        for patrol in ({}, {"surround_distance": 3.0, "contact_memory": 50.0})
    )
    assert plain.summary.trace_hash == other.summary.trace_hash
