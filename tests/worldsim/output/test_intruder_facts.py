"""What the summary says of intruders, from a journal whose robots report them and stand around them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from patrol.journal.records import SURROUNDING, Status
from patrol.radio.message import CONTACT, Position, decode, encode
from tests.worldsim.conftest import Lab
from worldsim.output.summary import summarise
from worldsim.run_record import MemoryJournal
from worldsim.verdict.judge import judge
from worldsim.world import World

PLACE = (8.0, 6.0)


def reporting(journal: MemoryJournal, ticks: range, place: tuple[float, float], key: bytes | None = None) -> None:
    """Let the first robot report an intruder in some ticks, and nobody report any in the others."""
    for record in journal.ticks:
        frames = []
        for source, frame in record.frames:
            if decode(frame).robot == CONTACT:
                continue
            frames.append((source, frame))
            if source == 1 and record.k in ticks:
                frames.append((1, encode(Position.of_contact(record.k, 0.5 * record.k, *place), key)))
        journal.records[record.k] = replace(record, frames=tuple(frames))


def standing(journal: MemoryJournal, ticks: range, robots: int, place: tuple[float, float]) -> None:
    """Let the first robots stand beside a place and surround it in some ticks."""
    for k in ticks:
        rows = [
            replace(row, state=SURROUNDING, x=place[0] + 1.0, y=place[1] - row.number) if row.number <= robots else row
            for row in journal.records[k].robots
        ]
        journal.records[k] = replace(journal.records[k], robots=tuple(rows))


def intruders_of(journal: MemoryJournal, world: World) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = summarise(journal, judge(journal, {}, world.prepared)).document()["intruders"]
    return found


@pytest.mark.parametrize("key", [None, b"fleet"])
def test_an_intruder_is_found_and_surrounded(lab: Lab, key: bytes | None) -> None:
    world = lab.patrol(ticks=40, intruders=[{"place": [8.0, 6.0], "at": 2, "for": 15}, {"place": [16.0, 12.0]}])
    journal = lab.run(world)
    reporting(journal, range(10, 30), PLACE, key)
    standing(journal, range(12, 14), 1, PLACE)
    standing(journal, range(14, 30), 2, PLACE)
    standing(journal, range(20, 24), 3, PLACE)
    one, other = intruders_of(journal, world)
    assert one == {
        "place_m": [8.0, 6.0],
        "at_s": 2.0,
        "until_s": 17.0,
        "first_reported_s": 5.0,
        "reported_s": 10.0,
        "surrounded_s": 8.0,
        "most_robots": 3,
    }
    assert (other["first_reported_s"], other["surrounded_s"], other["until_s"]) == (None, 0.0, None)


def test_who_comes_to_the_same_place_later_is_another_one(lab: Lab) -> None:
    world = lab.patrol(ticks=40, intruders=[{"place": [8.0, 6.0], "for": 5}, {"place": [8.0, 6.0], "at": 10, "for": 5}])
    journal = lab.run(world)
    reporting(journal, range(22, 26), PLACE)
    standing(journal, range(15, 30), 4, PLACE)
    one, other = intruders_of(journal, world)
    assert (one["first_reported_s"], one["surrounded_s"]) == (None, 0.0)
    assert (other["first_reported_s"], other["reported_s"], other["surrounded_s"]) == (11.0, 2.0, 5.0)


def test_robots_that_are_dead_far_away_or_patrolling_surround_nobody(lab: Lab) -> None:
    world = lab.patrol(ticks=20, intruders=[{"place": [8.0, 6.0]}], patrol={"surround_distance": 2.0})
    journal = lab.run(world)
    standing(journal, range(5, 20), 4, (14.0, 6.0))
    for k in range(5, 10):
        rows = tuple(replace(row, x=8.0, y=7.0, status=Status.DEAD) for row in journal.records[k].robots)
        journal.records[k] = replace(journal.records[k], robots=rows)
    (one,) = intruders_of(journal, world)
    assert (one["surrounded_s"], one["most_robots"]) == (0.0, 0)


def test_a_run_without_intruders_says_nothing_of_them(lab: Lab) -> None:
    world = lab.patrol(ticks=5)
    journal = lab.run(world)
    assert "intruders" not in summarise(journal, judge(journal, {}, world.prepared)).document()
