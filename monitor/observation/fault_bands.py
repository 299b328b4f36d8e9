"""The faults of a run over time, from the events of its journal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from patrol.journal.records import Event
from patrol.scenario.controls import intruder_name, intruders_came

if TYPE_CHECKING:
    from patrol.scenario import Scenario

FAULT, INTRUDER = "fault", "intruder"
LOSSES = ("dead", "lost")
"""Events after which a robot is gone, for good or until it is restarted."""

_BEGINS, _HAPPENS, _ENDS = "begins", "happens", "ends"


@dataclass(frozen=True, slots=True)
class Band:
    """A fault and its duration."""

    id: str  # of the fault; empty for a robot that was lost without a fault
    kind: str
    begin: float  # s
    end: float  # s; equal to `begin` for a fault without duration
    text: str = ""  # which robots or links it concerns, and its settings

    @property
    def lasts(self) -> bool:
        """True if it has a duration."""
        return self.end > self.begin


def bands_of(events: Iterable[Event], step: float, end_s: float) -> tuple[Band, ...]:
    """Return the faults of a run, and robots that were lost without a fault, by their beginnings.

    `events` are in order, and `step` is in s. A fault that did not end before ends with the run, at `end_s`.

    For example, with a step of 0.1 s, the events "jam1 jam begins: within 3 m" at tick 50 and "jam1 jam ends" at tick
    80 give the band of jam1 from 5 to 8 s.
    """
    bands: list[Band] = []
    open_bands: dict[str, int] = {}
    planned = False
    for event in events:
        time_s = min(event.k * step, end_s)
        if event.kind == FAULT:
            planned = True
            head, _, text = event.detail.partition(": ")
            words = head.split()
            name, kind, verb = (*words, "", "", "")[:3]
            if verb == _ENDS and name in open_bands:
                index = open_bands.pop(name)
                bands[index] = replace(bands[index], end=time_s)
            elif verb in (_BEGINS, _HAPPENS):
                if verb == _BEGINS:
                    open_bands[name] = len(bands)
                bands.append(Band(name, kind, time_s, end_s if verb == _BEGINS else time_s, text))
        # With planned faults a death comes from one, which has an event of its own.
        elif event.kind == LOSSES[1] or (event.kind == LOSSES[0] and not planned):
            bands.append(Band("", event.kind, time_s, time_s, event.detail))
    return tuple(bands)


def intruder_bands(scenario: Scenario, end_s: float) -> tuple[Band, ...]:
    """Return the intruders of a run that came, as bands with their names and places."""
    bands = []
    for index, begin_s, gone_s in intruders_came(scenario, end_s):
        x, y = scenario.intruders[index].place
        bands.append(Band(intruder_name(index), INTRUDER, begin_s, gone_s, f"at ({x:g}, {y:g})"))
    return tuple(bands)


def lanes(bands: Sequence[Band], most: int) -> list[tuple[str, list[Band]]]:
    """Arrange faults in rows; return the name and the faults of each row.

    A row has one fault or, with more than `most` faults, all of one kind.

    For example, fault jam1 has the row "jam1 jam", and with too many faults it shares the row "jam" with other jams.
    """
    rows: dict[str, list[Band]] = {}
    by_fault = len({(band.id, band.kind) for band in bands}) <= most
    for band in bands:
        by_id = "" if band.kind == INTRUDER else f" {band.kind}"
        name = f"{band.id}{by_id}".strip() if by_fault else band.kind
        rows.setdefault(name, []).append(band)
    return list(rows.items())
