"""The closings of each closure over a run, for the summary, read from the journal's events."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from patrol.journal.records import CLOSED, OPENED

if TYPE_CHECKING:
    from patrol.journal.records import Event, Header


def closure_figures(header: Header, events: Iterable[Event], ticks: int) -> dict[str, dict[str, Any]]:
    """Return `patrol.summary.model.ClosureFigures` of each closure, by name."""
    names = [str(closure["name"]) for closure in header.scenario.get("closures") or ()]
    closed_at: dict[str, int | None] = dict.fromkeys(names)
    closings, closed = dict.fromkeys(names, 0), dict.fromkeys(names, 0)
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
            closed[name] += max(ticks - begun, 0)
    step = float(header.scenario["step"])
    return {name: {"closings": closings[name], "closed_s": closed[name] * step} for name in names}
