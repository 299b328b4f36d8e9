"""Makes the picture of README that compares patrols: what watching each gains, and how fresh it keeps the ground.

Reads `docs/results/policies.csv`, of which `docs/results/policies.md` says how it was measured.

    python docs/pictures/gains.py
"""

from __future__ import annotations

import csv
import math
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from statistics import fmean

from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

HERE = Path(__file__).parent
OURS = {"stochastic": "stochastic", "potential-field": "paper", "committed": "tour"}
NAMES = {**OURS, "tour": "cyclic (tour)"}
RATIOS = (1, 1.5, 2, 3, 5, 10, 20)
HEIGHT, LETTER, GAP = 1.4, 0.032, 0.06
"""Room that a name takes, in percentage points of the gain, and that a letter takes, and the gap beside a point, in
natural logarithms of the ratio."""

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


def _places(name: str, ratio: float, gain: float) -> Iterator[tuple[float, float, float]]:
    """Yield where a name may stand, the nearest first: left and right end (logarithms of ratios), and height."""
    at, length = math.log(ratio), LETTER * len(name)
    for step in range(40):
        for sign in (1, -1):
            for left in (at + GAP, at - GAP - length):
                yield left, left + length, gain + 0.25 * HEIGHT * step * sign


def draw(axes: Axes, text: str, rival: str, ours: str) -> None:
    """Draw the points, each with its name; names keep clear of each other and of the points."""
    points = measured()
    taken = [(math.log(ratio) - 0.5 * GAP, math.log(ratio) + 0.5 * GAP, gain) for ratio, gain in points.values()]
    for policy, (ratio, gain) in sorted(points.items(), key=lambda item: (item[0] not in OURS, item[1][1])):
        ours_too = policy in OURS
        name = NAMES.get(policy, policy)
        axes.plot(ratio, gain, "o", color=ours if ours_too else rival, markersize=8 if ours_too else 5)
        left, right, height = next(
            place
            for place in _places(name, ratio, gain)
            if not any(
                place[0] < other[1] and other[0] < place[1] and abs(place[2] - other[2]) < HEIGHT for other in taken
            )
        )
        taken.append((left, right, height))
        axes.annotate(
            name,
            (ratio, gain),
            (math.exp(left if left > math.log(ratio) else right), height),
            color=ours if ours_too else text,
            fontsize=10 if ours_too else 8,
            fontweight="bold" if ours_too else "normal",
            ha="left" if left > math.log(ratio) else "right",
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
