"""What the summary says of intruders, from a journal whose robots report them and stand around them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from patrol.journal.records import SURROUNDING, Status
from patrol.radio.message import CONTACT, Position, decode, encode
from tests.worldsim.checks.judged import move, summary_of
from tests.worldsim.conftest import Lab
from worldsim.run_record import MemoryJournal
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
        for number in range(1, robots + 1):
            move(journal, k, number, state=SURROUNDING, x=place[0] + 1.0, y=place[1] - number)


def intruders_of(journal: MemoryJournal, world: World) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = summary_of((world, journal)).document()["intruders"]
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
    times = {"at_s": 2.0, "until_s": 17.0, "first_reported_s": 5.0, "reported_s": 10.0, "surrounded_s": 8.0}
    assert one == {"place_m": [8.0, 6.0], **times, "most_robots": 3}
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
        for number in (1, 2, 3, 4):
            move(journal, k, number, x=8.0, y=7.0, status=Status.DEAD)
    (one,) = intruders_of(journal, world)
    assert (one["surrounded_s"], one["most_robots"]) == (0.0, 0)
