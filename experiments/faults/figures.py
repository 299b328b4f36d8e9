"""Pictures of the faults experiment: MFoW over the share of lost frames, and the cost of all other conditions.

matplotlib is an optional dependency, so it is imported only when something is drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.faults.cost import VARIANTS, WITH_TRAIL, Finding
from experiments.paper.figures import COLOURS, write_figure
from patrol.extras import check_matplotlib

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 150
CURVES = (("loss", "independently", "-", "o"), ("bursts", "in bursts of 8", "--", "s"))
PANELS = (("", "bare positions"), (WITH_TRAIL, "with the last positions"))
NO_BARS = ("quiet", *(f"{group}{end}" for group, *_ in CURVES for end in ("", WITH_TRAIL)))


def curves_picture(found: Sequence[Finding], files: Sequence[Path]) -> bool:
    """Draw MFoW over the share of lost frames; return False if no loss was tried."""
    tried = {cost.condition.group for cost in found}
    shown = [(end, title) for end, title in PANELS if tried.intersection(f"{group}{end}" for group, *_ in CURVES)]
    if not shown:
        return False
    figure = _figure((1.0 + 5.0 * len(shown), 4.6))
    panels = figure.subplots(1, len(shown), sharey=True, squeeze=False)[0]
    for panel, (end, title) in zip(panels, shown, strict=True):
        for colour, variant in zip(COLOURS, VARIANTS, strict=False):
            for group, label, line, marker in CURVES:
                _curve(panel, found, f"{group}{end}", variant, f"{variant}, {label}", colour, line, marker)
        panel.set_title(title, loc="left", fontsize=10)
        panel.set_xlabel("share of frames lost")
        _bare(panel)
    panels[0].set_ylabel("mean MFoW (s)")
    panels[0].set_ylim(bottom=0.0)
    panels[0].legend(frameon=False, fontsize=8, loc="upper left")
    write_figure(figure, files)
    return True


def costs_picture(found: Sequence[Finding], files: Sequence[Path]) -> bool:
    """Draw the costs of all conditions without a curve as bars; return False if there are none."""
    shown = [cost for cost in found if cost.condition.group not in NO_BARS and cost.cost is not None]
    names = list(dict.fromkeys(_label(cost) for cost in shown))
    if not names:
        return False
    figure = _figure((9.0, 1.2 + 0.42 * len(names)))
    axes = figure.subplots()
    height = 0.8 / len(VARIANTS)
    for index, variant in enumerate(VARIANTS):
        for cost in shown:
            if cost.variant != variant or cost.cost is None:
                continue
            y = names.index(_label(cost)) - 0.4 + (index + 0.5) * height
            label = variant if _label(cost) == names[0] else None
            axes.barh(y, cost.cost.mean, 0.92 * height, color=COLOURS[index], label=label, zorder=2)
            if cost.cost.half:
                axes.errorbar(
                    cost.cost.mean, y, xerr=cost.cost.half, color="#222222", elinewidth=1.0, capsize=2.0, zorder=3
                )
    axes.axvline(1.0, color="black", linewidth=0.8, zorder=4)
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()
    axes.set_xlabel("mean MFoW, as a ratio to the same seed without faults")
    _bare(axes)
    axes.legend(frameon=False, fontsize=9, loc="lower right")
    write_figure(figure, files)
    return True


def _label(one: Finding) -> str:
    """Return a condition's name, with its group where the name is a number alone."""
    group, name = one.condition.group, one.condition.name
    return f"{group} {name}" if name[0].isdigit() else name


def _curve(
    axes: Axes, found: Sequence[Finding], group: str, variant: str, label: str, colour: str, line: str, marker: str
) -> None:
    points = sorted(
        (cost.condition.x or 0.0, cost.mfow.mean, cost.mfow.half or 0.0)
        for cost in found
        if cost.variant == variant and cost.condition.group in (group, "quiet") and cost.mfow is not None
    )
    if len(points) > 1:
        x, y, half = zip(*points, strict=True)
        axes.errorbar(x, y, half, color=colour, linestyle=line, marker=marker, markersize=4, capsize=2.0, label=label)


def _figure(size: tuple[float, float]) -> Figure:
    check_matplotlib("experiments")
    from matplotlib.figure import Figure

    return Figure(figsize=size, dpi=DPI, facecolor="white", layout="constrained")


def _bare(axes: Axes) -> None:
    axes.grid(color="#dddddd", linewidth=0.6, zorder=0)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
