"""The journal's events of zones that begin and end, and the verdict's check of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from patrol.journal import Event
from patrol.journal.records import IN_FORCE, OUT_OF_FORCE
from worldsim.verdict.judge import judge

if TYPE_CHECKING:
    from tests.worldsim.conftest import Lab

DISC = {"model": "holonomic", "radius": 0.4}
SQUARE = [[12, 8], [16, 8], [16, 12], [12, 12]]
NIGHT = {"name": "night", "polygon": SQUARE, "speed": 0.3, "times": [[0, 2], [4, 6]]}
SHIFT = {"name": "shift", "polygon": SQUARE, "weight": 2, "times": [[4, 5.6], [5.9, 6.4], [8, 99]]}
"""No tick lies between its first two times."""
VAULT = {"name": "vault", "polygon": SQUARE, "weight": 4}
TOLD = [
    (4, OUT_OF_FORCE, "night"),
    (8, IN_FORCE, "night"),
    (8, IN_FORCE, "shift"),
    (12, OUT_OF_FORCE, "night"),
    (13, OUT_OF_FORCE, "shift"),
    (16, IN_FORCE, "shift"),
]


def judged(lab: Lab, zones: list[dict[str, Any]], change: Any = None) -> tuple[list[Event], dict[str, str]]:
    """The events of zones in a run of 10 s, and the failed checks after a change of the journal's events."""
    world = lab.world([DISC], [(3.0, 3.0, 0.0)], duration=10.0, zones=zones)
    journal = lab.run(world)
    told = [event for event in journal.events if event.kind in (IN_FORCE, OUT_OF_FORCE)]
    if change is not None:
        journal.events = tuple(sorted(change(journal.events), key=lambda event: event.k))
    verdict = judge(journal, {}, world.prepared)
    assert ("zone times" in {check.name for check in verdict.checks}) == any("times" in zone for zone in zones)
    return told, {check.name: check.detail for check in verdict.failed}


def test_a_zone_that_begins_or_ends_is_an_event(lab: Lab) -> None:
    told, failed = judged(lab, [NIGHT, SHIFT, VAULT])
    assert [(event.k, event.kind, event.detail) for event in told] == TOLD
    assert failed == {}


def test_zones_without_times_give_no_events(lab: Lab) -> None:
    assert judged(lab, [VAULT]) == ([], {})


@pytest.mark.parametrize(
    ("removed", "added", "message"),
    [
        (2, (), "shift is in force from tick 8 on, and the journal has no event of it"),
        (5, ((15, IN_FORCE, "shift"),), "the journal has shift in force from tick 15 on, when nothing changes"),
        (None, ((2, IN_FORCE, "vault"),), "the journal has vault in force from tick 2 on, when nothing changes"),
        (None, (TOLD[1],), "the journal has night in force from tick 8 on, when nothing changes"),
    ],
)
def test_other_events_are_caught(
    lab: Lab, removed: int | None, added: tuple[tuple[int, str, str], ...], message: str
) -> None:
    gone = None if removed is None else TOLD[removed]

    def change(events: tuple[Event, ...]) -> list[Event]:
        kept = [event for event in events if (event.k, event.kind, event.detail) != gone]
        return [*kept, *(Event(k, kind, None, name) for k, kind, name in added)]

    assert judged(lab, [NIGHT, SHIFT, VAULT], change)[1]["zone times"] == message
