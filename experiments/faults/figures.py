"""Pictures of the faults experiment: MFoW over the share of lost frames, and the cost of all other conditions.

matplotlib is an optional dependency, so it is imported only when something is drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from experiments.faults.cost import VARIANTS, WITH_TRAIL, Finding
from experiments.sweeps.estimates import Curve, Dot, draw_curves, draw_dots, scale
from monitor.figures.style import INK, drawn, figure, write_figure
from patrol.palette import ROBOTS

CURVES = (("loss", "independently"), ("bursts", "in bursts of 8"))
PANELS = (("", "bare positions"), (WITH_TRAIL, "with the last positions"))
NO_DOTS = ("quiet", *(f"{group}{end}" for group, _ in CURVES for end in ("", WITH_TRAIL)))


def curves_picture(found: Sequence[Finding], files: Sequence[Path]) -> bool:
    """Draw MFoW over the share of lost frames; return False if no loss was tried."""
    tried = {cost.condition.group for cost in found}
    shown = [(end, title) for end, title in PANELS if tried.intersection(f"{group}{end}" for group, _ in CURVES)]
    if not shown:
        return False
    with drawn():
        chart = figure(1.0 + 5.0 * len(shown), 4.6)
        panels = chart.subplots(1, len(shown), sharey=True, squeeze=False)[0]
        for panel, (end, title) in zip(panels, shown, strict=True):
            draw_curves(panel, _loss_curves(found, end), "share of frames lost", "mean MFoW (s)")
            panel.set_title(title)
        panels[0].legend(loc="upper left")
    write_figure(chart, files)
    return True


def costs_picture(found: Sequence[Finding], files: Sequence[Path]) -> bool:
    """Draw the costs of all conditions without a curve; return False if there are none."""
    dots = [
        Dot(_condition_label(cost), cost.cost, cost.variant)
        for cost in found
        if cost.condition.group not in NO_DOTS and cost.cost is not None
    ]
    names = list(dict.fromkeys(dot.row for dot in dots))
    if not names:
        return False
    with drawn():
        chart = figure(9.0, 1.2 + 0.42 * len(names))
        axes = chart.subplots()
        draw_dots(axes, names, dots, list(VARIANTS), "mean MFoW, as a ratio to the same seed without faults")
        axes.axvline(1.0, color=INK, linewidth=0.8)
        scale(axes, [dot.found.mean for dot in dots])
        chart.legend(loc="outside upper left", ncols=len(VARIANTS))
    write_figure(chart, files)
    return True


def _condition_label(one: Finding) -> str:
    """Return a condition's name, with its group where the name is a number alone."""
    group, name = one.condition.group, one.condition.name
    return f"{group} {name}" if name[0].isdigit() else name


def _loss_curves(found: Sequence[Finding], end: str) -> list[Curve]:
    """Return a curve for each variant and kind of loss: a colour a variant, a style of line a kind."""
    curves = []
    for number, variant in enumerate(VARIANTS):
        for kind, (group, label) in enumerate(CURVES):
            points = sorted(
                (
                    (cost.condition.x or 0.0, cost.mfow)
                    for cost in found
                    if cost.variant == variant and cost.mfow and cost.condition.group in (f"{group}{end}", "quiet")
                ),
                key=lambda point: point[0],
            )
            if len(points) > 1:
                curves.append(Curve(f"{variant}, {label}", points, number + kind * len(ROBOTS)))
    return curves
