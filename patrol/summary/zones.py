"""The ages of the ground of each zone over a run, told to people; `worldsim.verdict.ages` computes them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from patrol.summary.metric import FiguresTable
from patrol.zones.spec import ELSEWHERE

if TYPE_CHECKING:
    from patrol.scenario import Scenario
    from patrol.summary.model import Summary, ZoneFigures


def zone_lines(summary: Summary) -> list[str]:
    """Describe the weighted MFoW, and how old the ground of each zone got."""
    mean_s = summary.mfow_weighted_mean_s
    if mean_s is None:
        return []
    best_s = summary.best_weighted_s
    tours = "" if best_s is None else f"; best tours {best_s:.1f} s"
    lines = [f"weighted    MFoW mean {mean_s:.1f} s, maximum {summary.mfow_weighted_max_s:.1f} s{tours}"]
    for name, zone in summary.zones.items():
        wish = ""
        if zone.wanted_s is not None and zone.kept_share is not None:
            wish = f"; wanted {zone.wanted_s:g} s, kept {100.0 * zone.kept_share:.1f} % of the time"
        weight = f"{'' if name == ELSEWHERE else 'last '}weight {zone.weight:g}"
        ages = f"stalest point {zone.mfow_mean_s:.1f} s in the mean, {zone.mfow_max_s:.1f} s at most"
        lines.append(f"            {name} ({weight}): mean age {zone.fog_mean_s:.1f} s, {ages}{wish}")
    return lines


def zone_table(summary: Summary, scenario: Scenario, end_s: float) -> FiguresTable:
    """Return each zone's rules, its times, and the ages of its ground meanwhile."""
    del end_s
    figures = summary.zones
    rows = [(zone.labels, zone.when, *_age_texts(figures.get(zone.name))) for zone in scenario.zones]
    if rows and (elsewhere := figures.get(ELSEWHERE)) is not None:
        rows.append((f"{ELSEWHERE} x{elsewhere.weight:g}", "always", *_age_texts(elsewhere)))
    ages = ("mean age while in force (s)", "of its stalest point, mean (s)", "of its stalest point, most (s)")
    heads = ("zone", "in force", *ages, "wanted age kept (% of that time)")
    return FiguresTable(heads, rows, range(2, 6))


def _age_texts(figures: ZoneFigures | None) -> tuple[str, str, str, str]:
    if figures is None:
        return "-", "-", "-", "-"
    share = "-" if figures.kept_share is None else f"{100.0 * figures.kept_share:.1f}"
    return f"{figures.fog_mean_s:.1f}", f"{figures.mfow_mean_s:.1f}", f"{figures.mfow_max_s:.1f}", share
