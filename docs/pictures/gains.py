"""Makes the picture of README that compares patrols: what watching each gains, and how fresh it keeps the ground.

Reads `docs/results/policies.csv`, of which `docs/results/policies.md` says how it was measured.

    python docs/pictures/gains.py
"""

from __future__ import annotations

import csv
import math
from collections import defaultdict
from pathlib import Path
from statistics import fmean

from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

HERE = Path(__file__).parent
OURS = {"stochastic": "stochastic", "potential-field": "paper", "committed": "tour"}
NAMES = {**OURS, "tour": "cyclic (tour)"}
RATIOS = (1, 1.5, 2, 3, 5, 10, 20)
HEIGHT, WIDTH = 1.4, 0.27
"""Room that a name takes: percentage points of the gain, and natural logarithms of the ratio."""

THEMES = {"light": ("#1a1a1a", "#8a8a8a", "#0072b2"), "dark": ("#e6e6e6", "#8a8a8a", "#56b4e9")}
"""Colour of text, of rivals, and of our patrols."""


def measured() -> dict[str, tuple[float, float]]:
    """Return of each policy the geometric mean of MFoW by the best tour's, and the mean gain of watching in points."""
    ratios, gains = defaultdict(list), defaultdict(list)
    with (HERE.parent / "results/policies.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            ratios[row["policy"]].append(math.log(float(row["mfow_s"]) / float(row["best_tour_s"])))
            watching = max(float(row["similar_percent"]), float(row["each_percent"]))
            gains[row["policy"]].append(watching - float(row["blind_percent"]))
    return {policy: (math.exp(fmean(ratios[policy])), fmean(gains[policy])) for policy in ratios}


def _touch(name: tuple[float, float], other: tuple[float, float]) -> bool:
    return abs(name[1] - other[1]) < HEIGHT and abs(math.log(name[0] / other[0])) < WIDTH


def draw(axes: Axes, text: str, rival: str, ours: str) -> None:
    """Draw the points, each with its name; names that would touch are moved apart."""
    names: list[tuple[float, float]] = []
    for policy, (ratio, gain) in sorted(measured().items(), key=lambda item: (item[0] not in OURS, item[1][1])):
        ours_too = policy in OURS
        axes.plot(ratio, gain, "o", color=ours if ours_too else rival, markersize=8 if ours_too else 5)
        heights = (gain + 0.5 * HEIGHT * step * sign for step in range(40) for sign in (1, -1))
        height = next(h for h in heights if not any(_touch((ratio, h), other) for other in names))
        names.append((ratio, height))
        axes.annotate(
            NAMES.get(policy, policy),
            (ratio, gain),
            (ratio * 1.07, height),
            color=ours if ours_too else text,
            fontsize=10 if ours_too else 8,
            fontweight="bold" if ours_too else "normal",
            va="center",
        )
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(FixedLocator(RATIOS))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.set_xlim(1.0, 25.0)
    axes.set_ylim(0.0, 42.0)
    axes.set_xlabel("age of the stalest place, times that on the best tour found", color=text)
    axes.set_ylabel("gain of watching, percentage points", color=text)
    axes.tick_params(colors=text)
    axes.grid(color=rival, alpha=0.3)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(rival)


def main() -> None:
    """Write the picture, for light and for dark pages."""
    plt.rcParams |= {"svg.hashsalt": "gains", "svg.fonttype": "none", "font.family": "sans-serif"}
    for theme, colours in THEMES.items():
        figure, axes = plt.subplots(figsize=(8.0, 4.6), layout="constrained")
        axes.patch.set_alpha(0.0)
        draw(axes, *colours)
        figure.savefig(HERE / f"gains-{theme}.svg", transparent=True, metadata={"Date": None})
        plt.close(figure)


if __name__ == "__main__":
    main()
