"""The maps of a report: mean and worst fog, and the robots' paths."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from monitor.figures.ground import draw_outline, fog_scale, frame, paint, rim
from monitor.figures.style import INK, MUTED, UNCOUNTED, colour, figure, plain
from monitor.replay.run import Run
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.journal.records import Status
from patrol.palette import MARKS, NEVER_SEEN, rgb
from patrol.scenario.marks import marks_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_Scalar = TypeVar("_Scalar", bound=np.generic)

MOST_PANELS = 12
"""Most robots with one panel each; more are drawn into one map."""

MOST_STEPS = 2500
"""Most points of a path."""

_LONGEST = 1600
"""Pixels along the longer side of a map; larger maps are thinned."""

PANEL_WIDTH = 4.7
"""Width of one of two panels, inches."""

MAP_EDGE, PANEL_EDGE = 3, 3
"""Width of a wall's edge in pixels, on a map and on the smaller panels of paths, which have half as many."""


def fog_chart(
    run: Run, fog_s: NDArray[Any], never: BoolGrid, label: str, most: float | None = None, has_site: bool = True
) -> Figure:
    """Return a map of the fog, `fog_s`, with the points that were `never` seen, both of shape (h, w).

    `most` is the end of the colour scale in s; None for the largest value. `has_site` adds zones and closures.
    """
    terrain, counted, scenario = run.prepared.terrain, run.prepared.patrolled, run.prepared.scenario
    chart, axes = _draw_map(terrain)
    most_s = float(fog_s[counted].max(initial=0.0)) if most is None else most
    scale = fog_scale(max(most_s, 1e-9))
    every = -(-max(terrain.shape) // _LONGEST)
    image = scale.to_rgba(_thin_grid(np.where(counted, fog_s, 0.0), every), bytes=True)
    image[~_thin_grid(counted, every)] = [round(255 * part) for part in UNCOUNTED]
    image[_thin_grid(counted & never, every)] = (*rgb(NEVER_SEEN), 255)
    paint(axes, terrain, image, _thin_grid(~terrain.passable, every), _LONGEST, MAP_EDGE)
    rims: dict[str, Any] = {"path_effects": rim(2.6)}
    for mark in marks_of(scenario, terrain) if has_site else ():
        if mark.points is not None:
            tone = MARKS[mark.kind]
            draw_outline(axes, terrain, mark.points, colors=tone, linewidths=1.3, **rims)
            axes.text(*mark.at, mark.label, color=tone, ha="center", va="center", fontsize=7, clip_on=True, **rims)
    chart.colorbar(scale, ax=axes, label=label, shrink=0.85, pad=0.02)
    return chart


def never_seen_note(never: BoolGrid) -> str:
    """Return a caption's sentence about the points that `fog_chart` shows as never seen; empty without any."""
    return " Purple: never seen." if never.any() else ""


def paths_chart(run: Run) -> Figure:
    """Draw the robots' paths: one panel for each robot, or one map for all robots of a large fleet."""
    terrain, count = run.prepared.terrain, len(run.names)
    if count > MOST_PANELS:
        chart, axes = _draw_map(terrain)
        _draw_ground(axes, terrain)
        for index in range(count):
            _draw_path(axes, run, index, 0.5)
        return chart
    xmin, ymin, xmax, ymax = terrain.bounds
    columns = min(count, 3 if xmax - xmin > 0.6 * (ymax - ymin) else 5)
    rows = -(-count // columns)
    width = 9.4 / columns
    chart = figure(9.4, rows * min(width * (ymax - ymin) / (xmax - xmin) + 0.3, 7.0))
    panels = chart.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
    for index, axes in enumerate(panels):
        if index >= count:
            axes.set_axis_off()
            continue
        _frame_axes(axes, terrain)
        axes.tick_params(labelbottom=False, labelleft=False, length=0)
        _draw_ground(axes, terrain)
        _draw_path(axes, run, index, 0.8)
        axes.set_title(f"{run.names[index]}: {run.robot_figures[index].distance_m:.0f} m", color=INK)
    return chart


def ground_panels(terrain: Terrain, count: int, width: float) -> tuple[Figure, list[Axes]]:
    """Draw the ground `count` times, side by side, each `width` inches wide."""
    xmin, ymin, xmax, ymax = terrain.bounds
    chart = figure(width * count, min(width * (ymax - ymin) / (xmax - xmin), 7.0) + 0.3)
    panels = list(chart.subplots(1, count, squeeze=False).ravel())
    for axes in panels:
        _frame_axes(axes, terrain)
        axes.tick_params(labelbottom=False, labelleft=False, length=0)
        _draw_ground(axes, terrain)
    return chart, panels


def _draw_map(terrain: Terrain) -> tuple[Figure, Axes]:
    xmin, ymin, xmax, ymax = terrain.bounds
    width = 5.3
    height = width * (ymax - ymin) / (xmax - xmin)
    if height > 6.5:
        width, height = width * 6.5 / height, 6.5
    chart = figure(width + 1.1, max(height, 1.6) + 0.5)
    axes = chart.add_subplot()
    _frame_axes(axes, terrain)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    return chart, axes


def _frame_axes(axes: Axes, terrain: Terrain) -> None:
    frame(axes, terrain)
    plain(axes, grid="none")


def _draw_ground(axes: Axes, terrain: Terrain) -> None:
    longest = _LONGEST // 2
    walls = _thin_grid(~terrain.passable, -(-max(terrain.shape) // longest))
    paint(axes, terrain, np.zeros((*walls.shape, 4), dtype=np.uint8), walls, longest, PANEL_EDGE)


def _draw_path(axes: Axes, run: Run, place: int, width: float) -> None:
    """Draw a path: a ring at its start, a dot at its end, or a cross if the robot was lost."""
    track = run.poses[:, place, :2].copy()
    # Lines break at NaN, so nothing joins the place where a robot left with that where it came back.
    track[np.isin(run.status[:, place], (Status.ABSENT, Status.LEFT))] = np.nan
    present = np.flatnonzero(~np.isnan(track[:, 0]))
    if not len(present):
        return
    every = -(-len(track) // MOST_STEPS)
    tone = colour(place)
    axes.plot(*track[::every].T, color=tone, linewidth=width, alpha=0.85, rasterized=len(run.names) > MOST_PANELS)
    begin, end = track[present[0]], track[present[-1]]
    last = Status(run.status[present[-1], place]).name.lower()
    if present[-1] == run.ticks - 1:
        last = run.robot_figures[place].status
    is_gone = last in ("dead", "lost")
    axes.plot(*begin, marker="o", markersize=5, markerfacecolor="none", markeredgecolor=MUTED)
    axes.plot(*end, marker="X" if is_gone else "o", markersize=7 if is_gone else 5, color=tone, markeredgecolor=INK)


def _thin_grid(grid: NDArray[_Scalar], every: int) -> NDArray[_Scalar]:
    """Return every n-th row and column.

    For example, a grid of 5 by 4 points has 3 by 2 left with `every` = 2.
    """
    return grid[::every, ::every]
