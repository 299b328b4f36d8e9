"""Makes the picture of `docs/results/intruders.md` that shows how fresh and how unpredictable a patrol can be at once.

The model: places are visited at intervals that are drawn independently from one law, whose mean is 1, so no visit is
wasted. An intruder needs a time `attack` for a place, in mean intervals. It knows how long ago the place was visited,
and chooses when to begin. It gains on one that begins at any time. Of the laws whose MFoW, here the greatest age among
`PLACES` places, is at most so large, one is searched for that lets it gain least. Real intruders know more, such as
where the robots are, and real robots waste some visits.

The measured points are those of that page's table of `unpredictability`. An attack takes as much of the mean interval
as the blind intruder of `docs/results/policies.csv` is seen.

    python docs/pictures/frontier.py
"""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from numpy.typing import NDArray

HERE = Path(__file__).parent
COLOURS = {"yards": "#0072b2", "open": "#d55e00", "clutter": "#009e73", "site": "#a0529c"}

STEPS = 16
"""Steps of time in a mean interval, about: the law that is searched for may move its mean a little."""
LONGEST = 3 * STEPS
"""Longest interval of a law, steps."""
PLACES = 100
RATIOS = (1.15, 1.2, 1.25, 1.3, 1.4, 1.5, 1.6, 1.8, 2.0)
"""Greatest MFoW of each law that is searched for, mean intervals."""
ROUNDS = 250
"""Steps down the slope of the cost, for each law."""

Law = NDArray[np.float64]
"""Probability of each interval, from one step on."""


def judge(law: Law, attack: float) -> tuple[float, float]:
    """Return the MFoW of a law in mean intervals, and what an intruder gains that knows the age of its place."""
    size = len(law)
    steps = np.arange(1, size + 1)
    mean = float(law @ steps)
    needs = max(1, round(attack * mean))
    # Probability that an interval is longer than so many steps.
    longer = np.append(np.cumsum(law[::-1])[::-1], np.zeros(size + needs + 1))
    of_age = longer[:size] / mean
    # Probability of a visit so many steps after one.
    again = np.zeros(size + 1)
    again[0] = 1.0
    for step in range(1, size + 1):
        again[step] = law[:step] @ again[step - 1 :: -1][:step]
    begin, end = np.arange(size + 1 - needs), np.arange(1, size + 1)
    first = np.append(law, np.zeros(size))[np.arange(size)[:, None] + end - 1]  # after an age; times `longer`
    visits = first @ np.where(end >= end[:, None], again[np.maximum(end - end[:, None], 0)], 0.0)
    since = begin + needs - end[:, None]
    unseen = longer[np.arange(size)[:, None] + begin + needs]
    unseen = unseen + visits @ np.where(end[:, None] <= begin, longer[np.maximum(since, 0)], 0.0)
    gain = float(unseen.max(axis=1).sum() - unseen[:, 0].sum()) / mean
    # An age is counted as that at the end of its step.
    oldest = (1.0 + float((1.0 - np.minimum(np.cumsum(of_age), 1.0) ** PLACES).sum())) / mean
    return oldest, gain


def frontier(attack: float) -> list[tuple[float, float]]:
    """Return MFoW and gain of the best laws found, the freshest first."""
    narrow = -0.5 * ((np.arange(1, LONGEST + 1) - STEPS) / 3.0) ** 2
    return [judge(law_of(search(narrow, attack, ratio)), attack) for ratio in RATIOS]


def cost_of(logs: Law, attack: float, ratio: float) -> float:
    """Return the gain, and more for a law that is older than wanted, or too fine or too coarse for the steps."""
    law = law_of(logs)
    (oldest, gain), mean = judge(law, attack), float(law @ np.arange(1, len(law) + 1))
    too_old = max(oldest - ratio, 0.0)
    return gain + too_old + 20.0 * too_old**2 + 0.1 * max(abs(mean - STEPS) - 2.0, 0.0) ** 2


def search(logs: Law, attack: float, ratio: float) -> Law:
    """Return the logarithms of a better law (Adam, by differences)."""
    cheapest, best = np.inf, logs
    mean, square = np.zeros(len(logs)), np.zeros(len(logs))
    for step in range(1, ROUNDS + 1):
        here = cost_of(logs, attack, ratio)
        if here < cheapest:
            cheapest, best = here, logs
        nudged = logs + 1e-4 * np.eye(len(logs))
        slope = (np.array([cost_of(row, attack, ratio) for row in nudged]) - here) / 1e-4
        mean, square = 0.9 * mean + 0.1 * slope, 0.99 * square + 0.01 * slope**2
        stride = 0.3 * (1.0 - step / ROUNDS) + 0.01
        logs = logs - stride * mean / (1.0 - 0.9**step) / (np.sqrt(square / (1.0 - 0.99**step)) + 1e-9)
        logs = np.clip(logs - logs.max(), -24.0, 0.0)
    return best


def law_of(logs: Law) -> Law:
    """Return the law with some logarithms of probabilities, but for a constant."""
    law = np.array([math.exp(log - logs.max()) for log in logs.tolist()])
    return law / law.sum()


def measured() -> dict[str, tuple[float, list[tuple[float, float]]]]:
    """Return of each ground how long an attack takes, and for each setting MFoW by the best tour's, and the gain."""
    with (HERE.parent / "results/policies.csv").open(encoding="utf-8") as file:
        blind = {
            row["ground"]: float(row["blind_percent"]) for row in csv.DictReader(file) if row["policy"] == "stochastic"
        }
    page = (HERE.parent / "results/intruders.md").read_text(encoding="utf-8")
    of_ground = {}
    for ground in COLOURS:
        (row,) = re.findall(rf"^\| `{ground}` \| ([\d., |]+) \|$", page, re.MULTILINE)
        points = [tuple(map(float, pair)) for pair in re.findall(r"([\d.]+), (\d+)", row)]
        of_ground[ground] = 1.0 - 0.01 * blind[ground], points
    return of_ground


def main() -> None:
    """Write the picture, and print the curves."""
    plt.rcParams |= {"svg.hashsalt": "frontier", "svg.fonttype": "none", "font.family": "sans-serif"}
    figure, axes = plt.subplots(figsize=(8.0, 4.6), layout="constrained")
    for ground, (attack, points) in measured().items():
        curve = [(oldest, 100.0 * gain) for oldest, gain in frontier(attack)]
        print(f"{ground}, attack {attack:.2f}:", ", ".join(f"{gain:.0f} at {oldest:.2f}" for oldest, gain in curve))
        axes.plot(
            *zip(*curve, strict=True), color=COLOURS[ground], label=f"{ground}: attacks of {attack:.2f} intervals"
        )
        axes.plot(*zip(*points, strict=True), "o:", color=COLOURS[ground])
    axes.set(xlim=(1.0, 2.0), ylim=(0.0, 32.0))
    axes.set(
        xlabel="age of the stalest place, times that on the best tour found",
        ylabel="gain of watching, percentage points",
    )
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
    figure.savefig(HERE / "frontier.svg", metadata={"Date": None})


if __name__ == "__main__":
    main()
