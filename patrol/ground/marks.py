"""Marks of a scenario's sections on maps, such as the outline of a zone or the place of a dock.

A section says itself how it is marked, so maps draw whatever there is (`patrol.scenario.marks`). `patrol.palette.MARKS`
has the colours.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from patrol.ground.terrain import BoolGrid, Terrain


class Mark(NamedTuple):
    """A mark on a map."""

    kind: str  # its colour and meaning, by `patrol.palette.MARKS`
    name: str  # of the section's entry
    label: str  # the name, and what holds there
    at: tuple[float, float]  # place of the label, m
    points: BoolGrid | None = None  # (h, w), the ground that is outlined; None for a place
    radius: float = 0.0  # of a place, m
    closes: bool = False  # the points may be closed, and are filled then
    section: str = ""  # name of the section in the scenario


class Moment(NamedTuple):
    """A time of a run, for the looks of marks: the clock, and the state of the ground."""

    time_s: float
    closed: Collection[str]  # names of the parts of the ground that are closed
    waiting: Collection[str]  # names of those that wait until bodies are clear of them


class Look(NamedTuple):
    """The look of a mark at a time."""

    text: str  # its label
    holds: bool  # what it says holds now: it is drawn strongly, with its label
    filled: bool = False  # its points are closed
    waits: bool = False  # what it says is to hold, and waits for something
    weight: float | None = None  # as it is, or would be if it held; None for what has none


def mark_ground(
    kind: str, name: str, label: str, points: BoolGrid, terrain: Terrain, *, closes: bool = False
) -> Mark | None:
    """Return the mark of some ground, or None if it has no point."""
    return Mark(kind, name, label, middle(points, terrain), points, closes=closes) if points.any() else None


def outline(points: BoolGrid, terrain: Terrain) -> NDArray[np.float64]:
    """Return the straight edges between some points and all others, float64 (n, 4): x and y in m of both ends.

    For example, a single point (0, 0) of 1 m gives the four sides of the square from (0, 0) to (1, 1).
    """
    rims = np.pad(points, 1)
    lines = [(row, *run) for row, runs in _row_runs(rims[1:] != rims[:-1]) for run in runs]
    edges = [(first, row, end, row) for row, first, end in lines]
    lines = [(col, *run) for col, runs in _row_runs((rims[:, 1:] != rims[:, :-1]).T) for run in runs]
    edges += [(col, first, col, end) for col, first, end in lines]
    sides: NDArray[np.float64] = np.array(edges, dtype=np.float64).reshape(-1, 4)
    # Edge 0 lies along the border, but runs begin in the padding, one point before it.
    sides[:, [0, 2]] -= np.where(sides[:, [1]] == sides[:, [3]], 1.0, 0.0)
    sides[:, [1, 3]] -= np.where(sides[:, [0]] == sides[:, [2]], 1.0, 0.0)
    return np.asarray(sides * terrain.point + np.tile(terrain.origin, 2))


def _row_runs(marked: BoolGrid) -> Iterator[tuple[int, list[tuple[int, int]]]]:
    """Yield each row of a grid that has marks, with the first column and the one after the last of each run of them."""
    for row in np.flatnonzero(marked.any(axis=1)).tolist():
        ends = np.flatnonzero(np.diff(np.pad(marked[row].view(np.int8), 1)))
        yield row, [(int(first), int(end)) for first, end in ends.reshape(-1, 2)]


def middle(points: BoolGrid, terrain: Terrain) -> tuple[float, float]:
    """Return x and y in m of the point that is nearest to the middle of some points."""
    rows, cols = np.nonzero(points)
    nearest = int(((rows - rows.mean()) ** 2 + (cols - cols.mean()) ** 2).argmin())
    return terrain.centre(int(rows[nearest]), int(cols[nearest]))
