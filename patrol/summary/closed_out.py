"""Ground that was closed out, by a closure or a wreck, and how old the other ground got: for people."""

from __future__ import annotations

from typing import TYPE_CHECKING

from patrol.summary.metric import FiguresTable

if TYPE_CHECKING:
    from patrol.scenario import Scenario
    from patrol.summary.model import ClosedOut, Summary


def closed_out_lines(summary: Summary) -> list[str]:
    """Describe how old the ground got while it was open to view, and the largest area that was closed out."""
    if summary.mfow_reachable_mean_s is None:
        return []
    lines = [f"reachable MFoW {_ages_text(summary)}"]
    if summary.closed_out:
        area, where, since, until = _cells(max(summary.closed_out, key=lambda spell: spell.area_m2))
        times = len(summary.closed_out)
        in_all = f"; {times} times in all" if times > 1 else ""
        lines.append(f"closed out  up to {area} around {where}, some ground from {since} to {until}{in_all}")
    return lines


def closed_out_table(summary: Summary, scenario: Scenario, end_s: float) -> FiguresTable:
    """Return when and where ground was closed out."""
    del scenario, end_s
    rows = [_cells(spell) for spell in summary.closed_out]
    text = f"Reachable MFoW: {_ages_text(summary)}." if rows else ""
    return FiguresTable(("largest area", "around", "from", "to"), rows, range(0), text)


def _ages_text(summary: Summary) -> str:
    mean_s, max_s = summary.mfow_reachable_mean_s or 0.0, summary.mfow_reachable_max_s or 0.0
    share = f"{100.0 * (summary.closed_out_share or 0.0):.1f} %"
    return f"mean {mean_s:.1f} s, maximum {max_s:.1f} s; closed out {share} of ground x time"


def _cells(spell: ClosedOut) -> tuple[str, str, str, str]:
    until = "the end" if spell.until_s is None else f"{spell.until_s:g} s"
    return f"{spell.area_m2:.0f} m²", f"({spell.x:.1f}, {spell.y:.1f})", f"{spell.since_s:g} s", until
