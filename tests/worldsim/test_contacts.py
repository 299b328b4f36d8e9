"""Intruders in the world: who sees them, and that their reports are carried and accounted for like positions."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from patrol.exchange import Reply
from patrol.pose import Velocity
from patrol.radio.message import MAX_CONTACTS, MAX_FRAME, Position, decode, encode
from tests.worldsim.conftest import Lab
from worldsim.verdict.judge import judge
from worldsim.world import World

DISC: dict[str, Any] = {"model": "holonomic", "radius": 0.4, "speed": 4.0}


def contacts(world: World) -> dict[int, tuple[tuple[float, float], ...]]:
    return {number: report.contacts for number, report in world.begin_tick().items()}


def end(world: World) -> None:
    world.end_tick({number: Reply(Velocity(0.0, 0.0), "holding", None, 1.0, 0) for number in world.living})


def test_an_intruder_is_seen_in_range_and_in_sight_only(lab: Lab) -> None:
    starts = [(9.0, 2.0, 0.0), (12.0, 2.0, 0.0), (9.0, 6.0, 0.0)]
    world = lab.world([DISC] * 3, starts, intruders=[{"place": [11.0, 2.0]}])
    assert contacts(world) == {1: (), 2: ((11.0, 2.0),), 3: ()}  # behind the wall, in sight, too far


def test_an_intruder_is_there_during_its_time(lab: Lab) -> None:
    world = lab.world([DISC], [(2.0, 2.0, 0.0)], intruders=[{"place": [3.0, 2.0], "at": 1.0, "for": 1.5}])
    seen = []
    for _ in range(7):
        seen.append(bool(contacts(world)[1]))
        end(world)
    assert seen == [False, False, True, True, True, False, False]


def test_an_intruder_is_in_nobodys_way(lab: Lab) -> None:
    world = lab.world([DISC], [(2.0, 2.0, 0.0)], intruders=[{"place": [3.0, 2.0]}])
    world.begin_tick()
    record = world.end_tick({1: Reply(Velocity(2.0, 0.0), "patrolling", None, 1.0, 0)})
    assert not record.robots[0].bumped
    assert world.bodies[1].pose.x == 3.0


def test_of_many_intruders_the_nearest_are_seen(lab: Lab) -> None:
    places = [[2.0 + 0.3 * index, 2.5] for index in (5, 1, 4, 2, 3)]
    world = lab.world([DISC], [(2.0, 2.0, 0.0)], intruders=[{"place": place} for place in places])
    seen = contacts(world)[1]
    assert len(seen) == MAX_CONTACTS
    assert [x for x, _ in seen] == sorted(x for x, _ in places)[:MAX_CONTACTS]


def test_contacts_are_carried_and_a_run_with_them_is_valid(lab: Lab) -> None:
    world = lab.patrol(ticks=20, intruders=[{"place": [4.0, 4.0]}, {"place": [4.0, 5.0]}])
    journal = lab.run(world)
    frames = [(source, decode(frame)) for record in journal.ticks for source, frame in record.frames]
    reported = [(source, frame) for source, frame in frames if frame.robot == 0]
    assert {source for source, _ in reported} >= {1}
    assert all(len(frame) <= MAX_FRAME for record in journal.ticks for _, frame in record.frames)
    first = next(iter(journal.ticks))
    assert [source for source, _ in first.frames] == [1, 1, 1, 2, 3, 4]
    assert len({*first.deliveries}) == len(first.deliveries) == 6 * 3
    verdict = judge(journal, {}, world.prepared)
    assert verdict.valid, verdict.failed


@pytest.mark.parametrize(("x", "k", "twice"), [(4.5, 0, False), (4.0, 1, False), (4.0, 0, True)])
def test_a_report_of_what_its_sender_does_not_see_fails(lab: Lab, x: float, k: int, twice: bool) -> None:
    world = lab.patrol(ticks=5, intruders=[{"place": [4.0, 4.0]}])
    journal = lab.run(world)
    first = journal.records[0]
    false = encode(Position.of_contact(k, 0.5 * k, x, 4.0))
    reports = [*([frame for source, frame in first.frames if source == 1][1:] if twice else []), false]
    kept = [(source, frame) for source, frame in first.frames if source != 1 or decode(frame).robot == 1]
    journal.records[0] = replace(first, frames=(*kept, *((1, frame) for frame in reports)))
    problem = next(check for check in judge(journal, {}, world.prepared).failed if check.name == "frames")
    assert "sees no such intruder" in problem.detail


def test_a_contact_that_its_sender_sees_and_does_not_report_fails(lab: Lab) -> None:
    world = lab.patrol(ticks=5, intruders=[{"place": [4.0, 4.0]}])
    journal = lab.run(world)
    first = journal.records[0]
    assert [source for source, _ in first.frames] == [1, 1, 2, 3, 4]
    journal.records[0] = replace(first, frames=(first.frames[0], *first.frames[2:]))
    problem = next(check for check in judge(journal, {}, world.prepared).failed if check.name == "frames")
    assert problem.detail == "r1 did not send a contact in tick 0"
