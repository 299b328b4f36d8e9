"""The closings of each closure over a run: from the journal's events into the summary, and from there to people."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from patrol.journal.records import CLOSED, OPENED
from patrol.summary.metric import FiguresTable

if TYPE_CHECKING:
    from patrol.journal.records import Event, Header, TickRecord
    from patrol.scenario import Scenario
    from patrol.summary.model import Summary


class ClosureTotals:
    """Counts the ticks of a run, until its events tell what was closed."""

    def __init__(self, header: Header, events: Sequence[Event]) -> None:
        """Start before the first tick."""
        del events
        self._names = [str(closure["name"]) for closure in header.scenario.get("closures") or ()]
        self._step = float(header.scenario["step"])
        self._ticks = 0

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        del record
        self._ticks += 1

    def figures(self, events: Sequence[Event]) -> dict[str, Any]:
        """Return the summary's `patrol.summary.model.ClosureFigures` of each closure.

        For example, with steps of 0.5 s, closed before tick 4 and opened before tick 10 gives 1 closing of 3 s.
        """
        closed_at: dict[str, int | None] = dict.fromkeys(self._names)
        closings, closed = dict.fromkeys(self._names, 0), dict.fromkeys(self._names, 0)
        for event in events:
            name = event.detail
            if name not in closed_at:
                continue
            begun = closed_at[name]
            if event.kind == CLOSED:
                closed_at[name] = event.k
                closings[name] += 1
            elif event.kind == OPENED and begun is not None:
                closed[name] += event.k - begun
                closed_at[name] = None
        for name, begun in closed_at.items():
            if begun is not None:
                # It was closed to the end. 0 for one that closed after the last tick.
                closed[name] += max(self._ticks - begun, 0)
        figures = {name: {"closings": closings[name], "closed_s": closed[name] * self._step} for name in self._names}
        return {"closures": figures} if figures else {}


def closure_lines(summary: Summary) -> list[str]:
    """Describe what was closed."""
    if not summary.closures:
        return []
    closings = sum(closure.closings for closure in summary.closures.values())
    names = [name for name, closure in summary.closures.items() if closure.closings]
    longest = max(names, key=lambda name: summary.closures[name].closed_s, default="")
    longest_text = f", {longest} longest, {summary.closures[longest].closed_s:g} s" if longest else ""
    return [f"closures    closed {closings} times{longest_text}"]


def closure_table(summary: Summary, scenario: Scenario, end_s: float) -> FiguresTable:
    """Return how often and how long each closure was closed."""
    del scenario, end_s
    rows = [(name, f"{closure.closings}", f"{closure.closed_s:g}") for name, closure in summary.closures.items()]
    return FiguresTable(("closure", "times closed", "closed for (s)"), rows, range(1, 3))
