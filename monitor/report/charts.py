"""The charts of a report: over time, by robot, and by link."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from monitor.figures.style import ACCENT, ALERT, GRID, INK, MUTED, WIDTH, colour, figure, logarithmic, plain
from monitor.observation.fault_bands import INTRUDER, Band, lanes
from monitor.replay.belief_errors import BeliefErrors
from monitor.replay.run import Run
from patrol.journal.records import CHARGING, DEAD_END, DOCKING, FREE, Status

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_LANES = 8
"""Most faults with one row each; more faults share a row by kind."""

MOST_POINTS = 3000
"""Most points of a line; longer lines keep the largest value of each interval."""

MOST_CELLS = 14
"""Most robots for which the shares are written into the matrix of links."""

MOST_NAMED = 40
"""Most robots whose rows are all named."""

MOST_BINS = 60
"""Most bars of a histogram."""

STATES: tuple[tuple[str, str], ...] = (
    ("patrolling", "#8fbcd9"),
    ("free", "#3c7d5f"),
    ("dead end", "#e69f00"),
    ("surrounding", "#009e73"),
    ("holding", "#f0e442"),
    ("docking", "#e8b7d0"),
    ("charging", "#cc79a7"),
    ("other", "#0072b2"),
    ("no decision", "#b9a3c9"),
    ("paused", "#9aa3ad"),
    ("dead or lost", "#c4161c"),
    ("absent", "#00000000"),
)
"""The states of a robot in the chart, with their colours."""

_PATROLLING, _FREE, _DEAD_END, _SURROUNDING, _HOLDING, _DOCKING, _CHARGING = range(7)
_OTHER, _SILENT, _PAUSED, _GONE, _AWAY = range(7, len(STATES))


def mfow_chart(run: Run, bands: Sequence[Band], tour_s: float | None = None) -> Figure:
    """Draw MFoW and mean fog over time, below the faults.

    `tour_s` is the MFoW on the best tour found; None for none.
    """
    chart, axes, rows = _with_lanes(run, bands, 3.4)
    times, mfow = thinned(run.times, run.mfow.astype(np.float64) * run.step)
    axes.plot(times, mfow, color=ACCENT, label="MFoW (age of the stalest point)")
    times, mean = thinned(run.times, run.fog_mean * run.step)
    axes.plot(times, mean, color=INK, linewidth=1.0, label="mean fog")
    bound = run.journal.header.bound_s
    if bound > 0.0:
        axes.axhline(bound, color=MUTED, linewidth=1.0, linestyle=(0, (5, 3)), label="lower bound of MFoW")
    if tour_s:
        axes.axhline(tour_s, color=MUTED, linewidth=1.0, linestyle=(0, (1, 2)), label="best tour found")
    axes.set_ylabel("fog (s)")
    axes.set_ylim(bottom=0.0)
    _draw_legend(axes, rows)
    return chart


def belief_chart(run: Run, errors: BeliefErrors, bands: Sequence[Band]) -> Figure:
    """Draw the mean difference between each robot's believed fog and the true one over time, below the faults."""
    chart, axes, rows = _with_lanes(run, bands, 2.7)
    times = errors.ticks * run.step
    for column, robot in enumerate(errors.robots):
        name = run.names[robot] if len(errors.robots) <= 10 else None
        axes.plot(times, errors.mean[:, column] * run.step, color=colour(robot), linewidth=1.2, label=name)
    axes.set_ylabel("|believed - true| (s)")
    axes.set_ylim(bottom=0.0)
    _draw_legend(axes, rows)
    return chart


def radio_chart(run: Run, bands: Sequence[Band]) -> Figure:
    """Draw the delivered share of the robots' frames over time, below the faults."""
    chart, axes, _ = _with_lanes(run, bands, 2.2)
    width = max(1, run.ticks // 240)
    delivered, dropped = (
        np.add.reduceat(counts, range(0, run.ticks, width)) for counts in (run.links.delivered_in, run.links.dropped_in)
    )
    share = np.where(delivered + dropped > 0, delivered / np.maximum(delivered + dropped, 1), np.nan)
    times = (np.arange(len(share)) + 0.5) * width * run.step
    axes.plot(times, 100.0 * share, color=ACCENT)
    axes.set_ylabel("delivered (%)")
    axes.set_ylim(-2.0, 104.0)
    return chart


def states_chart(run: Run, bands: Sequence[Band]) -> Figure:
    """Draw the state of each robot in each tick, and its cancelled moves."""
    from matplotlib.colors import ListedColormap
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    count = len(run.names)
    chart, axes, _ = _with_lanes(run, bands, 0.8 + min(0.26 * count, 8.0), shade=False)
    doing = state_codes(run)
    width = max(1, run.ticks // 1600)
    shown = doing[::width].T
    extent = (0.0, run.ticks * run.step, count - 0.5, -0.5)
    axes.imshow(
        shown,
        aspect="auto",
        interpolation="none",
        extent=extent,
        cmap=ListedColormap([tone for _, tone in STATES]),
        vmin=-0.5,
        vmax=len(STATES) - 0.5,
    )
    ticks, places = np.nonzero(run.bumped)
    if len(ticks):
        size = 7 if count <= MOST_NAMED else 3
        axes.plot(ticks * run.step, places, linestyle="none", marker="|", markersize=size, color=INK)
    _name_rows(axes, run.names)
    plain(axes, grid="none")
    used = np.unique(doing)
    keys = [Patch(facecolor=tone, label=name) for code, (name, tone) in enumerate(STATES[:-1]) if code in used]
    keys.append(Line2D([], [], linestyle="none", marker="|", color=INK, markersize=8, label="cancelled move"))  # type: ignore[arg-type]
    chart.legend(handles=keys, loc="outside lower left", ncols=7)
    return chart


def state_codes(run: Run) -> NDArray[np.uint8]:
    """uint8 (ticks, n), index in `STATES` of each robot's state."""
    status, labels = run.status, run.labels
    kinds = {"": _SILENT, DEAD_END: _DEAD_END, DOCKING: _DOCKING, CHARGING: _CHARGING}
    kinds |= {"patrolling": _PATROLLING, FREE: _FREE, "surrounding": _SURROUNDING, "holding": _HOLDING}
    doing = np.array([kinds.get(label, _OTHER) for label in labels], dtype=np.uint8)[run.states]
    doing[status == Status.PAUSED] = _PAUSED
    doing[(status == Status.DEAD) | (status == Status.LOST)] = _GONE
    doing[(status == Status.ABSENT) | (status == Status.LEFT)] = _AWAY
    return doing


def gaps_chart(gaps: NDArray[np.int64], step: float) -> Figure:
    """Draw a histogram of the times between two visits to a point.

    `gaps` is int64 (n,), the number of gaps by length in ticks (`Visits.gaps`). `step` is in s.
    """
    chart = figure(WIDTH, 2.9)
    axes = chart.add_subplot()
    waits, weights = np.flatnonzero(gaps) * step, gaps[np.flatnonzero(gaps)].astype(np.float64)
    if len(waits):
        # All bins span the same number of ticks, or evenly distributed gaps would look uneven.
        ends = int(np.flatnonzero(gaps)[-1]) + 1
        width = -(-ends // MOST_BINS)
        begins = np.arange(0, ends, width)
        shares = 100.0 * np.add.reduceat(gaps[:ends], begins) / weights.sum()
        edges = (begins - 0.5) * step
        axes.bar(edges, shares, width * step, align="edge", color=ACCENT, edgecolor=GRID, linewidth=0.4)
        order = np.cumsum(weights) / weights.sum()
        for part, name, down in ((0.5, "median", 9), (0.95, "95 %", 21)):  # one below the other, for they may be close
            wait = float(waits[np.searchsorted(order, part)])
            axes.axvline(wait, color=INK, linewidth=1.0, linestyle=(0, (4, 3)))
            above = axes.get_xaxis_transform()
            axes.annotate(f"{name} {wait:g} s", (wait, 1.0), (4, -down), xycoords=above, textcoords="offset points")
    axes.set_xlim(left=0.0)
    axes.set_xlabel("time between two visits to a point (s)")
    axes.set_ylabel("share of gaps (%)")
    plain(axes)
    return chart


def links_chart(run: Run) -> Figure:
    """Draw the delivered share of each directed link."""
    share, count = 100.0 * run.links.share(), len(run.names)
    side = min(1.6 + 0.5 * count, 6.4)
    chart = figure(side + 1.2, side)
    axes = chart.add_subplot()
    image = axes.imshow(share, cmap="cividis", vmin=0.0, vmax=100.0, interpolation="none")
    places = range(count) if count <= MOST_CELLS else range(0, count, max(1, count // 10))
    names = [run.names[index] for index in places]
    axes.set_xticks(list(places), names, rotation=90 if max(map(len, names)) > 3 else 0)
    axes.set_yticks(list(places), names)
    axes.set_xlabel("to")
    axes.set_ylabel("from")
    if count <= MOST_CELLS:
        for (row, column), percent in np.ndenumerate(share):
            if not np.isnan(percent):
                # It stands on the colour itself, so it does not depend on the theme.
                tone = "#ffffff" if percent < 55.0 else "#000000"
                axes.text(column, row, _percent_text(percent), ha="center", va="center", fontsize=8, color=tone)
    plain(axes, grid="none")
    chart.colorbar(image, ax=axes, label="delivered (%)", shrink=0.9)
    return chart


def decisions_chart(run: Run) -> Figure:
    """Draw the decision times of each robot: 25th to 75th and 1st to 99th percentile, median and maximum."""
    count = len(run.names)
    chart = figure(WIDTH, min(1.0 + 0.28 * count, 9.0))
    axes = chart.add_subplot()
    for index in range(count):
        times = run.decision_ms[:, index]
        times = times[~np.isnan(times)]
        if not len(times):
            continue
        low, quarter, median, three, high = np.percentile(times, (1, 25, 50, 75, 99))
        axes.plot((low, high), (index, index), color=MUTED, linewidth=1.2, solid_capstyle="butt")
        axes.plot((quarter, three), (index, index), color=ACCENT, linewidth=7.0, solid_capstyle="butt")
        axes.plot(median, index, marker="|", markersize=11, markeredgewidth=2.0, color=INK)
        axes.plot(times.max(), index, marker="x", markersize=5, color=ALERT)
    _name_rows(axes, run.names)
    axes.set_ylim(count - 0.4, -0.6)
    logarithmic(axes, "x")
    axes.set_xlabel("decision time (ms, logarithmic)")
    plain(axes, grid="x")
    return chart


def troubles_chart(run: Run) -> Figure:
    """Draw the share of each robot's decisions in dead ends, and the number of its cancelled moves."""
    count = len(run.names)
    chart = figure(WIDTH, min(1.0 + 0.26 * count, 8.0))
    left, right = chart.subplots(1, 2, sharey=True)
    left.barh(
        range(count),
        [100.0 * robot.dead_end_share for robot in run.robot_figures],
        height=0.62,
        color=STATES[_DEAD_END][1],
    )
    left.set_xlabel("decisions in dead ends (%)")
    right.barh(range(count), run.bumped.sum(axis=0), height=0.62, color=ACCENT)
    right.set_xlabel("moves cancelled because of a collision")
    _name_rows(left, run.names)
    left.set_ylim(count - 0.4, -0.6)
    for axes in (left, right):
        plain(axes, grid="x")
        axes.set_xlim(0.0, max(axes.get_xlim()[1], 1.0))
    right.locator_params(axis="x", integer=True)
    return chart


def thinned(times: NDArray[np.float64], values: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Reduce a line to at most `MOST_POINTS` points: the largest value of each interval.

    For example, of a line of 9000 points, the largest of each three stays, at its own time.
    """
    width = -(-len(values) // MOST_POINTS)
    if width <= 1:
        return times, values
    begins = np.arange(0, len(values), width)
    picked = np.array([begin + int(np.argmax(values[begin : begin + width])) for begin in begins])
    return times[picked], values[picked]


def _name_rows(axes: Axes, names: Sequence[str]) -> None:
    """Write the robots' names beside their rows; of a large fleet every tenth."""
    rows = range(0, len(names), 1 if len(names) <= MOST_NAMED else 10)
    axes.set_yticks(rows, [names[row] for row in rows])


def _with_lanes(run: Run, bands: Sequence[Band], height: float, shade: bool = True) -> tuple[Figure, Axes, int]:
    """Draw a chart over the run's time, with the faults in rows above it and shaded in it; and the number of rows."""
    end = run.ticks * run.step
    rows = lanes(bands, MOST_LANES)
    if not rows:
        chart = figure(WIDTH, height)
        axes = chart.add_subplot()
    else:
        strip = 0.19 * len(rows) + 0.1
        chart = figure(WIDTH, height + strip)
        top, axes = chart.subplots(2, 1, sharex=True, height_ratios=(strip, height))
        for row, (_, several) in enumerate(rows):
            for band in several:
                _mark_fault(top, band, row, end)
        top.set_yticks(range(len(rows)), [name for name, _ in rows], fontsize=8)
        top.set_ylim(len(rows) - 0.4, -0.6)
        top.tick_params(length=0, labelbottom=False)
        top.spines[:].set_visible(False)
        plain(top, grid="none")
        for band in bands if shade else ():
            if band.lasts:
                axes.axvspan(band.begin, band.end, color=_band_tone(band), alpha=0.08, linewidth=0)
            else:
                axes.axvline(band.begin, color=_band_tone(band), alpha=0.7, linewidth=0.9)
    axes.set_xlim(0.0, end)
    axes.set_xlabel("time (s)")
    plain(axes)
    return chart, axes, len(rows)


def _mark_fault(axes: Axes, band: Band, row: int, end: float) -> None:
    """Draw a fault in its row: a bar, or a mark for one without duration."""
    if band.lasts:
        # A fault of one tick in a long run would be too thin to see.
        width = max(band.end - band.begin, 0.003 * end)
        axes.barh(row, width, left=band.begin, height=0.62, color=_band_tone(band), alpha=0.75)
    else:
        axes.plot(band.begin, row, marker="v", markersize=5, color=_band_tone(band), clip_on=False)


def _band_tone(band: Band) -> str:
    """Return the colour of a band: intruders are no faults."""
    return ACCENT if band.kind == INTRUDER else ALERT


def _draw_legend(axes: Axes, rows: int) -> None:
    """Draw the legend above the chart or, below rows of faults, into its corner."""
    if not axes.get_legend_handles_labels()[0]:
        return
    if rows:
        axes.legend(loc="upper left", ncols=10, borderaxespad=0.1)
        low, high = axes.get_ylim()
        axes.set_ylim(low, high * 1.12)
    else:
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=10, borderaxespad=0.2)


def _percent_text(value: float) -> str:
    """Return a share in percent; one below 100 never reads as 100.

    For example, 99.97 gives "99.9", 98.6 gives "99", and 100 gives "100".
    """
    return f"{min(value, 99.9):.1f}" if 99.0 < value < 100.0 else f"{value:.0f}"
