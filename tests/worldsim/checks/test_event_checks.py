"""The verdict's check of the journal's events: forged ones, missing ones and moved ones are caught."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from patrol.journal import Event
from tests.worldsim.checks.judged import Result, failures, result_of
from tests.worldsim.conftest import Lab
from worldsim.checks.statuses import EventsFollow
from worldsim.run_record import INTERRUPTED
from worldsim.world import World

TICKS = 24
DISC = {"model": "holonomic", "radius": 0.4}
STARTS = [(3.0, 3.0, 0.0), (3.1, 3.0, 0.0), (14.0, 4.0, 0.0)]
FAULTS = [
    {"kind": "loss", "rate": 0.2, "at": 1.0, "for": 4.0},
    {"kind": "pause", "who": "r3", "at": 2.0, "for": 2.0},
    {"kind": "kill", "who": "r3", "at": 5.0, "wreck": "removed"},
    {"kind": "pause", "who": "r3", "at": 5.5, "for": 1.0},
    {"kind": "restart", "who": "r3", "at": 7.0},
    {"kind": "kill", "who": "r1", "at": 0.0},
    {"kind": "join", "who": "r2", "at": 8.0},
]
"""r2 cannot join, because the wreck of r1 lies at its start. Pausing r3 and letting it go on makes no sense while it is
dead, nor does the second pause's end."""

MADE = [
    (0, "fault", None, "f6 kill happens: r1"),
    (0, "dead", 1, "f6 kill"),
    (2, "fault", None, "f1 loss begins: all to all, rate 0.2"),
    (4, "fault", None, "f2 pause begins: r3"),
    (4, "paused", 3, "f2 pause"),
    (8, "fault", None, "f2 pause ends"),
    (8, "alive", 3, "f2 resume"),
    (10, "fault", None, "f1 loss ends"),
    (10, "fault", None, "f3 kill happens: r3, wreck removed"),
    (10, "dead", 3, "f3 kill"),
    (11, "fault", None, "f4 pause begins: r3"),
    (11, "skipped", 3, "f4 pause: r3 is dead"),
    (13, "fault", None, "f4 pause ends"),
    (13, "skipped", 3, "f4 resume: r3 is dead"),
    (14, "fault", None, "f5 restart happens: r3"),
    (14, "alive", 3, "f5 restart: process 2"),
    (16, "fault", None, "f7 join happens: r2"),
    (16, "waiting", 2, "its start is taken by r1"),
]


def run(lab: Lab, stop: Callable[[World], bool] | None = None, **more: Any) -> Result:
    world = lab.world([DISC] * 3, STARTS, duration=0.5 * TICKS, faults=FAULTS, **more)
    return world, lab.run(world, None, lambda: stop is not None and stop(world))


def failed(result: Result, *events: Event) -> dict[str, str]:
    """The checks that fail with these events."""
    result[1].events = tuple(sorted(events, key=lambda event: event.k))
    return failures(result)


def caught(result: Result, events: list[Event]) -> bool:
    world, journal = result
    journal.events = tuple(sorted(events, key=lambda event: event.k))
    return not result_of(EventsFollow, world.prepared, journal).ok


def test_events_as_they_were_made_pass(lab: Lab) -> None:
    result = run(lab)
    assert [(event.k, event.kind, event.robot, event.detail) for event in result[1].events] == MADE
    assert failures(result) == {}


@pytest.mark.parametrize("forged", [{"k": 1}, {"kind": "alive"}, {"kind": "x"}, {"robot": 2}, {"detail": "f6 x"}])
def test_each_field_of_each_event_counts(lab: Lab, forged: dict[str, Any]) -> None:
    result = run(lab)
    events = list(result[1].events)
    for place, event in enumerate(events):
        other = replace(event, **forged)
        assert caught(result, [*events[:place], other, *events[place + 1 :]]) or other == event


def test_an_event_that_is_missing_or_there_twice_is_caught(lab: Lab) -> None:
    result = run(lab)
    events = list(result[1].events)
    for place, event in enumerate(events):
        assert caught(result, events[:place] + events[place + 1 :])
        assert caught(result, [*events, event])


@pytest.mark.parametrize("kind", ["closed", "in force", "waiting", "looked at", "trapped"])
def test_events_that_nothing_makes_are_caught(lab: Lab, kind: str) -> None:
    result = run(lab)
    problem = f'the journal has "{kind}" (box) before tick 3, which nothing made'
    assert failed(result, *result[1].events, Event(3, kind, None, "box")) == {"events": problem}


GROUND: dict[str, Any] = {
    "closures": [{"name": "box", "polygon": [[8, 8], [9, 8], [9, 9], [8, 9]], "closed": [[2, 4]]}],
    "zones": [
        {"name": "vault", "polygon": [[10, 8], [11, 8], [11, 9], [10, 9]], "weight": 2, "times": [[4, 6]]},
        {"name": "ward", "polygon": [[12, 8], [13, 8], [13, 9], [12, 9]], "weight": 2},
    ],
}


@pytest.mark.parametrize(
    ("kind", "detail"),
    [
        ("closed", "r2 broke down and was towed"),
        ("opened", "ghost"),
        ("stays open", "vault"),
        ("waiting", "ghost waits to close: r2 in it"),
        ("in force", "box"),
        ("out of force", "ward"),
    ],
)
def test_only_what_the_scenario_has_closes_opens_begins_or_ends(lab: Lab, kind: str, detail: str) -> None:
    result = run(lab, **GROUND)
    assert failures(result) == {}
    problem = f'the journal has "{kind}" ({detail}) before tick 7, which nothing made'
    assert failed(result, *result[1].events, Event(7, kind, None, detail))["events"] == problem


@pytest.mark.parametrize(
    ("kind", "detail"), [("closed", "box"), ("waiting", "box waits to close: r2 in it"), ("in force", "vault")]
)
def test_the_ground_does_not_change_after_the_last_tick(lab: Lab, kind: str, detail: str) -> None:
    result = run(lab, **GROUND)
    problem = f'the journal has "{kind}" ({detail}) before tick {TICKS}, which nothing made'
    assert failed(result, *result[1].events, Event(TICKS, kind, None, detail)) == {"events": problem}


def test_at_a_pace_nothing_says_when_a_robot_began_to_wait(lab: Lab) -> None:
    result = run(lab, pace=10)
    *events, last = result[1].events
    assert failed(result, *events, replace(last, k=20)) == {}
    assert "events" in failed(result, *events, replace(last, detail="its start is taken by r3"))


@pytest.mark.parametrize("more", range(3))
def test_a_run_may_be_interrupted_among_the_events_of_a_tick(lab: Lab, more: int) -> None:
    result = run(lab, lambda world: world.tick == 10)
    assert result[1].end
    result[1].end = replace(result[1].end, reason=INTERRUPTED)
    *some, last = [Event(*fields) for fields in MADE if fields[0] == 10][: more + 1]
    before = result[1].events
    assert failed(result, *before, *some, last) == {}
    assert list(failed(result, *before, *some, replace(last, detail="f9 loss ends"))) == ["events"]
    assert list(failed(result, *before, Event(11, "fault", None, "f4 pause begins: r3"))) == ["events"]
