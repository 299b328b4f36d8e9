"""Makes the picture of `docs/results/intruders.md` that shows how fresh and how unpredictable a patrol can be at once.

The model: places are visited at intervals that are drawn independently from one law, whose mean is 1, so no visit is
wasted. An intruder needs a time `attack` for a place, in mean intervals. It knows how long ago the place was visited,
and chooses when to begin. It gains on one that begins at any time. Of the laws whose MFoW, here the greatest age among
`PLACES` places, is at most so large, one is searched for that lets it gain least. Real intruders know more, such as
where the robots are, and real robots waste some visits.

The measured points are those of that page's table of `unpredictability`. An attack takes as much of the mean interval
as the blind intruder of `docs/results/policies.md` is seen.

    python docs/pictures/frontier.py
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from numba import njit
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
WIDTHS = (3.0, 6.0, 12.0)
"""Standard deviations of the laws that searches begin with, steps."""
ROUNDS = 1_000
"""Steps down the slope of the cost, in each search."""

Law = NDArray[np.float64]
"""Probability of each interval, from one step on."""


@njit(nogil=True)
def judge(logs: Law, attack: float) -> tuple[float, float, float]:
    """Judge the law with some logarithms of probabilities, but for a constant.

    Returns:
        Its mean in steps, its MFoW in mean intervals, and what an intruder gains that knows the age of its place.
    """
    size = len(logs)
    law = np.array([math.exp(log) for log in logs])
    law /= law.sum()
    mean = 0.0
    for step in range(size):
        mean += law[step] * (step + 1)
    needs = max(1, round(attack * mean))
    # Probabilities that an interval is longer than so many steps, and of a visit so many steps after one.
    longer, again = np.zeros(2 * size + needs + 2), np.zeros(size + 1)
    for step in range(size - 1, -1, -1):
        longer[step] = longer[step + 1] + law[step]
    again[0] = 1.0
    for step in range(1, size + 1):
        for first in range(step):
            again[step] += law[first] * again[step - 1 - first]
    informed, blind, oldest, younger = 0.0, 0.0, 1.0, 0.0
    visits = np.zeros(size + 1)
    for age in range(size):
        for step in range(1, size + 1):
            visits[step] = 0.0
            for first in range(1, min(step, size - age) + 1):
                visits[step] += law[age + first - 1] * again[step - first]
        best = 0.0
        for begin in range(size + 1 - needs):
            unseen = longer[age + begin + needs]
            for step in range(1, begin + 1):
                unseen += visits[step] * longer[begin + needs - step]
            best = max(best, unseen)
        informed += best / mean
        blind += longer[age + needs] / mean
        younger += longer[age] / mean
        # An age is counted as that at the end of its step.
        oldest += 1.0 - min(younger, 1.0) ** PLACES
    return mean, oldest / mean, informed - blind


def frontier(attack: float) -> list[tuple[float, float]]:
    """Return MFoW and gain of the best laws found, the freshest first."""
    steps = np.arange(1, LONGEST + 1)
    starts = [-0.5 * ((steps - STEPS) / width) ** 2 for width in WIDTHS]
    found: list[tuple[float, float]] = []
    for ratio in RATIOS:
        logs = min((search(start, attack, ratio) for start in starts), key=lambda logs: cost_of(logs, attack, ratio))
        starts = [*starts[: len(WIDTHS)], logs]  # and from the law before
        found.append(judge(logs, attack)[1:])
    return found


@njit(nogil=True)
def cost_of(logs: Law, attack: float, ratio: float) -> float:
    """Return the gain, and more for a law that is older than wanted, or too fine or too coarse for the steps."""
    mean, oldest, gain = judge(logs, attack)
    too_old = max(oldest - ratio, 0.0)
    return gain + too_old + 20.0 * too_old**2 + 0.1 * max(abs(mean - STEPS) - 2.0, 0.0) ** 2


@njit(nogil=True)
def search(logs: Law, attack: float, ratio: float) -> Law:
    """Return the logarithms of a better law (Adam, by differences)."""
    cheapest, best = np.inf, logs
    mean, square, slope = np.zeros(len(logs)), np.zeros(len(logs)), np.zeros(len(logs))
    for step in range(1, ROUNDS + 1):
        here = cost_of(logs, attack, ratio)
        if here < cheapest:
            cheapest, best = here, logs.copy()
        for at in range(len(logs)):
            nudged = logs.copy()
            nudged[at] += 1e-4
            slope[at] = (cost_of(nudged, attack, ratio) - here) / 1e-4
        mean, square = 0.9 * mean + 0.1 * slope, 0.99 * square + 0.01 * slope**2
        stride = 0.3 * (1.0 - step / ROUNDS) + 0.01
        logs = logs - stride * mean / (1.0 - 0.9**step) / (np.sqrt(square / (1.0 - 0.99**step)) + 1e-9)
        logs = np.minimum(np.maximum(logs - logs.max(), -24.0), 0.0)
    return best


def measured() -> dict[str, tuple[float, list[tuple[float, float]]]]:
    """Return of each ground how long an attack takes, and for each setting MFoW by the best tour's, and the gain."""
    policies = (HERE.parent / "results/policies.md").read_text(encoding="utf-8")
    rows = re.search(r"\| policy \| mean \|(.*)\|\n.*\n\| \*`blind` against `stochastic`\* \| \d+ \|(.*)\|", policies)
    assert rows is not None
    shares = dict(zip(rows[1].replace(" ", "").split("|"), map(float, rows[2].split("|")), strict=True))
    page = (HERE.parent / "results/intruders.md").read_text(encoding="utf-8")
    of_ground = {}
    for ground in COLOURS:
        (row,) = re.findall(rf"^\| `{ground}` \| ([\d., |]+) \|$", page, re.MULTILINE)
        points = [(float(ratio), float(gain)) for ratio, gain in re.findall(r"([\d.]+), (\d+)", row)]
        of_ground[ground] = 1.0 - 0.01 * shares[ground], points
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
