"""The verdict's check of closures."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from patrol.journal import Event
from tests.worldsim.checks.judged import Result, checks, failures, move
from tests.worldsim.conftest import Lab
from worldsim.run_record import MemoryJournal

DISC = {"model": "holonomic", "radius": 0.4}


def run(lab: Lab, *zones: dict[str, Any], duration: float = 6.0, **more: Any) -> Result:
    """A run of one robot that stays far from the rectangle."""
    faults, closures = list(more.pop("faults", ())), list(more.pop("closures", ()))
    site = {"zones": list(zones), "faults": faults, "closures": closures}
    world = lab.world([{**DISC, **more}], [(3.0, 3.0, 0.0)], None, duration=duration, **site)
    return world, lab.run(world)


def retell(journal: MemoryJournal, *events: Event) -> None:
    journal.events = tuple(sorted(events, key=lambda event: event.k))


BOX = {"name": "box", "polygon": [[14.0, 10.0], [16.0, 10.0], [16.0, 12.0], [14.0, 12.0]]}
AT_TIMES = {"closed": [[2, 6]]}
"""It closes at tick 4 and opens at tick 12."""
AT_RANDOM = {"closes": 0.5, "opens": 0.5}


def closing(lab: Lab, when: dict[str, Any] = AT_TIMES, faults: Any = ()) -> Result:
    return run(lab, duration=10.0, closures=[{**BOX, **when}], faults=faults)


@pytest.mark.parametrize("when", [AT_TIMES, AT_RANDOM, {}], ids=["times", "rates", "never"])
def test_a_run_as_asked_passes(lab: Lab, when: dict[str, Any]) -> None:
    faults = [
        {"kind": "close", "closure": "box", "at": 1, "for": 2},
        {"kind": "open", "closure": "box", "at": 2},
        {"kind": "close", "closure": "box", "at": 5, "for": 3},
    ]
    for some in ([], faults):
        result = closing(lab, when, some)
        assert "closures" in checks(result)
        assert failures(result) == {}


@pytest.mark.parametrize(("x", "caught"), [(14.5, True), (13.7, True), (13.5, False)])
def test_a_body_in_a_closed_closure_is_caught(lab: Lab, x: float, caught: bool) -> None:
    result = closing(lab)
    move(result[1], 8, 1, x=x, y=11.0)
    problems = failures(result)
    assert ("closures" in problems) == ("bodies apart" in problems) == caught
    if caught:
        assert problems["closures"].startswith(f"r1 is in box at tick 8, which is closed, at ({x:.3f}, 11.000)")


@pytest.mark.parametrize(
    ("events", "message"),
    [
        ((), "box is open at tick 4, when it is to be closed and nobody is in it"),
        (((6, "closed"), (12, "opened")), "box is open at tick 4, when it is to be closed and nobody is in it"),
        (((3, "closed"), (12, "opened")), "box is closed at tick 3, when it is to be open"),
        (((4, "closed"),), "box is closed at tick 12, when it is to be open"),
        (((4, "closed"), (8, "opened")), "box is open at tick 8, when it is to be closed and nobody is in it"),
    ],
)
def test_closings_at_other_times_are_caught(lab: Lab, events: tuple[tuple[int, str], ...], message: str) -> None:
    result = closing(lab)
    retell(result[1], *(Event(k, kind, None, "box") for k, kind in events))
    assert failures(result)["closures"] == message


@pytest.mark.parametrize(
    ("k", "kind", "detail", "message"),
    [
        (4, "closed", "box", "before tick 4 the journal has closed and closed of box, and should have closed"),
        (9, "closed", "box", "before tick 9 the journal has closed of box, and should have nothing"),
        (14, "stays open", "box", "before tick 14 the journal has stays open of box, and should have nothing"),
        (2, "waiting", "box waits to close: r1 in it", "before tick 2 the journal has waiting of box"),
    ],
)
def test_events_that_change_nothing_are_caught(lab: Lab, k: int, kind: str, detail: str, message: str) -> None:
    result = closing(lab)
    retell(result[1], *result[1].events, Event(k, kind, None, detail))
    assert failures(result)["closures"].startswith(message)


def test_the_robots_that_a_closure_waits_for_are_those_in_it(lab: Lab) -> None:
    """One robot is in the box, one so near that a closed point could reach it, and one far away."""
    starts = [(15.0, 11.0, 0.0), (13.2, 11.0, 0.0), (3.0, 3.0, 0.0)]
    world = lab.world([{**DISC, "speed": 0.001}] * 3, starts, duration=4.0, closures=[{**BOX, "closed": [[1, 9]]}])
    journal = lab.run(world)
    waiting = Event(2, "waiting", 1, "box waits to close: r1 in it")
    assert journal.events == (waiting,)
    assert failures((world, journal)) == {}
    details = [{"detail": f"box waits to close: {names} in it"} for names in ("", "r3", "r1, r3", "r2")]
    for forged in ({"robot": 2}, *details):
        journal.events = (replace(waiting, **forged),)  # type: ignore[arg-type]
        assert list(failures((world, journal))) == ["closures"]


@pytest.mark.parametrize(
    ("kind", "own", "by_itself", "message"),
    [
        ("open", AT_TIMES, [(4, "closed"), (12, "opened")], "box is closed at tick 8, when it is to be open"),
        ("close", {}, [], "box is open at tick 8, when it is to be closed and nobody is in it"),
    ],
)
def test_a_closure_that_obeys_no_fault_is_caught(lab: Lab, kind: str, own: Any, by_itself: Any, message: str) -> None:
    result = closing(lab, own, [{"kind": kind, "closure": "box", "at": 4, "for": 1}])
    others = [event for event in result[1].events if event.detail != "box"]
    retell(result[1], *others, *(Event(k, kind, None, "box") for k, kind in by_itself))
    assert failures(result)["closures"] == message
