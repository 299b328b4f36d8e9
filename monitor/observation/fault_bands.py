"""When something was wrong with a run, as its journal's events tell it: faults from their beginning to their end."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from patrol.journal.records import Event

FAULT = "fault"
LOSSES = ("dead", "lost")
"""Events by which a robot is gone for good or until it is restarted."""

_BEGINS, _HAPPENS, _ENDS = "begins", "happens", "ends"


@dataclass(frozen=True, slots=True)
class Band:
    """A fault from `begin` to `end`, s; a moment when both are equal. text: whom it befalls and how."""

    id: str
    kind: str
    begin: float
    end: float
    text: str = ""

    @property
    def lasts(self) -> bool:
        """Whether it is more than a moment."""
        return self.end > self.begin


def bands_of(events: Iterable[Event], step: float, end_s: float) -> tuple[Band, ...]:
    """The faults of a run that lasted `end_s`, by their beginnings; one that has not ended lasts to the end.

    A robot that was lost without any fault's doing is a moment of its own.
    """
    bands: list[Band] = []
    open_bands: dict[str, int] = {}
    planned = False
    for event in events:
        at = min(event.k * step, end_s)
        if event.kind == FAULT:
            planned = True
            head, _, text = event.detail.partition(": ")
            words = head.split()
            name, kind, verb = (*words, "", "", "")[:3]
            if verb == _ENDS and name in open_bands:
                place = open_bands.pop(name)
                before = bands[place]
                bands[place] = Band(before.id, before.kind, before.begin, at, before.text)
            elif verb in (_BEGINS, _HAPPENS):
                if verb == _BEGINS:
                    open_bands[name] = len(bands)
                bands.append(Band(name, kind, at, end_s if verb == _BEGINS else at, text))
        elif event.kind == LOSSES[1] or (event.kind == LOSSES[0] and not planned):
            bands.append(Band("", event.kind, at, at, event.detail))
    return tuple(bands)


def lanes(bands: Sequence[Band], most: int) -> list[tuple[str, list[Band]]]:
    """The bands in rows with a name each: a row per fault, or per kind where there are more than `most` faults."""
    rows: dict[str, list[Band]] = {}
    by_fault = len({(band.id, band.kind) for band in bands}) <= most
    for band in bands:
        name = f"{band.id} {band.kind}".strip() if by_fault else band.kind
        rows.setdefault(name, []).append(band)
    return list(rows.items())
