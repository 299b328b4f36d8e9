"""The verdict's check of closures, and that of the ground as it was in each tick."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest

from patrol.journal import Event
from worldsim.verdict.judge import judge

if TYPE_CHECKING:
    from tests.worldsim.conftest import Lab

DISC = {"model": "holonomic", "radius": 0.4}
BOX = {"name": "box", "polygon": [[14.0, 10.0], [16.0, 10.0], [16.0, 12.0], [14.0, 12.0]]}


def failed(lab: Lab, change: Any = None, when: Any = None, faults: Any = ()) -> dict[str, str]:
    """The failed checks of a run of 10 s with a box that closes at tick 4 and opens at tick 12, after a change."""
    closures = [{**BOX, **({"closed": [[2, 6]]} if when is None else when)}]
    world = lab.world([DISC], [(3.0, 3.0, 0.0)], duration=10.0, closures=closures, faults=faults)
    journal = lab.run(world)
    if change is not None:
        change(journal)
    verdict = judge(journal, {}, world.prepared)
    assert "closures" in {check.name for check in verdict.checks}
    return {check.name: check.detail for check in verdict.failed}


def test_a_run_as_asked_passes(lab: Lab) -> None:
    assert failed(lab) == {}
    assert failed(lab, when={"closes": 0.5, "opens": 0.5}) == {}
    assert failed(lab, when={}) == {}
    faults = [
        {"kind": "close", "closure": "box", "at": 1, "for": 2},
        {"kind": "open", "closure": "box", "at": 2},
        {"kind": "close", "closure": "box", "at": 5, "for": 3},
    ]
    for when in (None, {}, {"closes": 0.5, "opens": 0.5}):
        assert failed(lab, when=when, faults=faults) == {}


@pytest.mark.parametrize(("x", "caught"), [(14.5, True), (13.7, True), (13.5, False)])
def test_a_body_in_a_closed_closure_is_caught(lab: Lab, x: float, caught: bool) -> None:
    def move(journal: Any) -> None:
        record = journal.records[8]
        journal.records[8] = replace(record, robots=(replace(record.robots[0], x=x, y=11.0),))

    problems = failed(lab, move)
    assert ("closures" in problems) == caught
    assert ("bodies apart" in problems) == caught
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
    def retell(journal: Any) -> None:
        others = [event for event in journal.events if event.detail != "box"]
        journal.events = (*others, *(Event(k, kind, None, "box") for k, kind in events))

    assert failed(lab, retell)["closures"] == message


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
    def forge(journal: Any) -> None:
        journal.events = tuple(sorted([*journal.events, Event(k, kind, None, detail)], key=lambda event: event.k))

    assert failed(lab, forge)["closures"].startswith(message)


def test_the_robots_that_a_closure_waits_for_are_those_in_it(lab: Lab) -> None:
    """One robot is in the box, one so near that a closed point could reach it, and one far away."""
    starts = [(15.0, 11.0, 0.0), (13.2, 11.0, 0.0), (3.0, 3.0, 0.0)]
    world = lab.world([{**DISC, "speed": 0.001}] * 3, starts, duration=4.0, closures=[{**BOX, "closed": [[1, 9]]}])
    journal = lab.run(world)
    assert journal.events == (Event(2, "waiting", 1, "box waits to close: r1 in it"),)
    assert judge(journal, {}, world.prepared).valid
    for forged in (
        {"detail": "box waits to close:  in it"},
        {"detail": "box waits to close: r3 in it"},
        {"detail": "box waits to close: r1, r3 in it"},
        {"robot": 2},
        {"detail": "box waits to close: r2 in it"},
    ):
        journal.events = (replace(Event(2, "waiting", 1, "box waits to close: r1 in it"), **forged),)
        assert [check.name for check in judge(journal, {}, world.prepared).failed] == ["closures"]


@pytest.mark.parametrize(
    ("kind", "own", "message"),
    [
        ("open", None, "box is closed at tick 8, when it is to be open"),
        ("close", {}, "box is open at tick 8, when it is to be closed and nobody is in it"),
    ],
)
def test_a_closure_that_obeys_no_fault_is_caught(lab: Lab, kind: str, own: Any, message: str) -> None:
    def disobey(journal: Any) -> None:
        theirs = [event for event in journal.events if event.detail != "box"]
        by_itself = [] if own is not None else [Event(4, "closed", None, "box"), Event(12, "opened", None, "box")]
        journal.events = tuple(sorted([*theirs, *by_itself], key=lambda event: event.k))

    fault = {"kind": kind, "closure": "box", "at": 4, "for": 1}
    assert failed(lab, disobey, own, [fault])["closures"] == message


def test_without_closures_there_is_no_such_check(lab: Lab) -> None:
    world = lab.world([DISC], [(3.0, 3.0, 0.0)], duration=2.0)
    assert "closures" not in {check.name for check in judge(lab.run(world), {}, world.prepared).checks}
