"""The verdict's check of radio range: true places and walls, without the code that carries frames."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.faults.kinds import Range
from worldsim.kernels.sightlines import crossings, touched
from worldsim.verdict.common.faults import NO_ROBOT, FrameFaultCheck
from worldsim.verdict.frames.airborne import causes_before, fates, fault_of, kind_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from patrol.ground.terrain import Terrain
    from patrol.journal.records import TickRecord
    from worldsim.faults import Entry
    from worldsim.radio.ether import Link
    from worldsim.verdict.common.check import JudgedRun, Readings

ROUNDING_M = 1e-9
"""Distances that are this near to the reach count as within and as beyond it, m."""

GRAZING_M = 1e-5
"""A line that passes a wall's corner this closely may or may not count as a line of sight, m."""

_DIAGONAL = 1e-6
"""Lines whose sides differ by less are as steep as a diagonal, points: they may be cut into columns or rows."""

_BEFORE_RANGE = causes_before(Range)
"""Causes that stop a frame before its reach matters."""

Place = tuple[float, float]


class Sightlines:
    """Counts walls on lines, from running sums along each column and each row of the terrain."""

    def __init__(self, terrain: Terrain) -> None:
        opaque = ~terrain.passable
        self._origin = terrain.origin
        self._point = terrain.point
        self._sums = tuple(_running(mask) for mask in (opaque, opaque.T))

    def walls(self, a: Place, b: Place, margin: float) -> int:
        """Count the points of wall that a line touches.

        `margin` is how much the line is widened or, where negative, narrowed, m.
        """
        sums, ends = self._cuts(a, b)[0]
        return int(touched(sums, *ends, margin / self._point).sum())

    def crossings(self, a: Place, b: Place) -> tuple[int, int]:
        """Return the least and the greatest number of walls that a line crosses, however thick they are.

        The line is cut into columns, or into rows where it is steeper than its diagonals. A wall is an unbroken stretch
        of these in which the line touches points of wall. One in which the line only grazes them may count or not.
        """
        counts = [crossings(sums, *ends, GRAZING_M / self._point) for sums, ends in self._cuts(a, b)]
        return min(least for least, _ in counts), max(greatest for _, greatest in counts)

    def _cuts(self, a: Place, b: Place) -> list[tuple[NDArray[np.int64], tuple[float, float, float, float]]]:
        """Return running sums and the ends in points; a line that is nearly a diagonal may be cut both ways."""
        (x0, y0), (x1, y1) = (
            tuple((place[axis] - self._origin[axis]) / self._point for axis in (0, 1)) for place in (a, b)
        )
        by_column, by_row = self._sums
        steeper = abs(y1 - y0) - abs(x1 - x0)
        cuts = [(by_column, (x0, y0, x1, y1)), (by_row, (y0, x0, y1, x1))]
        return cuts if abs(steeper) < _DIAGONAL else cuts[1:] if steeper > 0.0 else cuts[:1]


class WithinReach(FrameFaultCheck):
    """Frames that passed a `range` were within reach and, where walls count, in sight when they were sent.

    Frames that one stopped were not.
    """

    name = "reach"
    kinds = (Range,)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._sightlines = Sightlines(run.prepared.terrain)
        self._stopped = 0

    def _active_tick(self, record: TickRecord, entries: Sequence[Entry]) -> None:
        places = {row.number: (row.x, row.y) for row in record.robots}
        for origin, link, why in fates(record, self._forgers):
            kind = kind_of(why)
            if kind in _BEFORE_RANGE or origin == NO_ROBOT:
                continue
            a, b = places[origin], places[link[1]]
            stopped = kind == "range"
            self._stopped += stopped
            for entry in entries:
                if origin not in entry.who or (stopped and entry.id != fault_of(why)):
                    continue
                if self._out_of_reach(entry, a, b, sure=not stopped) is not stopped:
                    self._wrong(link, record.k, entry, stopped=stopped)
                    return

    def _good(self) -> str:
        return f"{self._stopped} frames were out of reach, and no other was stopped"

    def _out_of_reach(self, entry: Entry, a: Place, b: Place, *, sure: bool) -> bool:
        """Return True if b is out of reach from a: for sure, or as far as rounding can tell."""
        fault = entry.fault
        assert isinstance(fault, Range)
        if math.dist(a, b) > fault.reach + (ROUNDING_M if sure else -ROUNDING_M):
            return True
        margin = -GRAZING_M if sure else GRAZING_M
        return not fault.through_walls and self._sightlines.walls(a, b, margin) > 0

    def _wrong(self, link: Link, k: int, entry: Entry, *, stopped: bool) -> None:
        problem = "was stopped by range {} although it was within reach" if stopped else "got through range {}"
        self._fail(f"{self._frame(link, k)} {problem.format(entry.id)}")


def _running(mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Count the set points below each row, column by column; int64 (h + 1, w)."""
    return np.ascontiguousarray(np.pad(np.cumsum(mask, axis=0, dtype=np.int64), ((1, 0), (0, 0))))
