"""The verdict's check of radio range: true places and walls, looked at without the code that carries frames."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.journal.records import FORGED
from patrol.scenario.faults.kinds import Range
from worldsim.radio.ether import OVERSIZED, OWN
from worldsim.verdict.checks import Check, names_of
from worldsim.verdict.frames.airborne import NO_ROBOT, active, fates, fault_of, forgers_of, kind_of

if TYPE_CHECKING:
    from patrol.ground.terrain import Terrain
    from patrol.journal.records import TickRecord
    from worldsim.radio.ether import Link
    from worldsim.run_record import RunRecord
    from worldsim.timeline import Entry, Timeline

ROUNDING_M = 1e-9
"""Distances as near to the reach as that count as either, m."""

GRAZING_M = 1e-5
"""A line that passes a wall's corner as closely as that may count as a line of sight or not, m."""

_BEFORE_RANGE = (OVERSIZED, OWN, "silence", "partition")
"""Why a frame is stopped before its reach counts."""

Place = tuple[float, float]


class Sightlines:
    """How many points of wall lie on a line, from running sums along each column and each row of the terrain."""

    def __init__(self, terrain: Terrain) -> None:
        opaque = ~terrain.passable
        self._origin = terrain.origin
        self._point = terrain.point
        self._sums = tuple(_running(mask) for mask in (opaque, opaque.T))

    def walls(self, a: Place, b: Place, margin: float) -> int:
        """Points of wall that the line from a to b touches, widened by `margin` m or, where negative, narrowed."""
        (x0, y0), (x1, y1) = (
            tuple((place[axis] - self._origin[axis]) / self._point for axis in (0, 1)) for place in (a, b)
        )
        by_column, by_row = self._sums
        sums = by_column
        if abs(y1 - y0) > abs(x1 - x0):
            sums, x0, y0, x1, y1 = by_row, y0, x0, y1, x1
        if x0 > x1:
            x0, y0, x1, y1 = x1, y1, x0, y0
        more = margin / self._point
        begin, end = x0 - more, x1 + more
        if begin > end:
            return 0
        height, width = sums.shape[0] - 1, sums.shape[1]
        columns = np.arange(max(math.floor(begin), 0), min(math.floor(end), width - 1) + 1)
        slope = (y1 - y0) / (x1 - x0) if x1 > x0 else 0.0
        enters, leaves = (y0 + slope * (np.clip(columns + side, begin, end) - x0) for side in (0, 1))
        low = np.clip(np.floor(np.minimum(enters, leaves) - more), 0, height).astype(np.int64)
        high = np.clip(np.floor(np.maximum(enters, leaves) + more) + 1.0, low, height).astype(np.int64)
        return int(np.sum(sums[high, columns] - sums[low, columns]))


class WithinReach:
    """What came through a `range` was within reach and, where walls count, in sight when it was sent.

    What was stopped by one was not.
    """

    def __init__(self, journal: RunRecord, terrain: Terrain, timeline: Timeline) -> None:
        self._names = {**names_of(journal), FORGED: "a forger"}
        self._ranges = [entry for entry in timeline.entries if isinstance(entry.fault, Range)]
        self._forgers = forgers_of(timeline)
        self._sightlines = Sightlines(terrain)
        self._problem = ""
        self._stopped = 0

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        ranges = [entry for entry in self._ranges if active(entry, record.k)]
        if not ranges or self._problem:
            return
        places = {row.number: (row.x, row.y) for row in record.robots}
        for origin, link, why in fates(record, self._forgers):
            kind = kind_of(why)
            if kind in _BEFORE_RANGE or origin == NO_ROBOT:
                continue
            a, b = places[origin], places[link[1]]
            stopped = kind == "range"
            self._stopped += stopped
            for entry in ranges:
                if origin not in entry.who or (stopped and entry.id != fault_of(why)):
                    continue
                if self._out_of_reach(entry, a, b, sure=not stopped) is not stopped:
                    self._wrong(link, record.k, entry, stopped=stopped)
                    return

    def check(self) -> Check:
        """The result, once all ticks are in."""
        good = f"{self._stopped} frames were out of reach, and no other was stopped"
        return Check("reach", not self._problem, self._problem or good)

    def _out_of_reach(self, entry: Entry, a: Place, b: Place, *, sure: bool) -> bool:
        """Whether b is out of reach from a: for sure, or as far as rounding can tell."""
        fault = entry.fault
        assert isinstance(fault, Range)
        if math.dist(a, b) > fault.reach + (ROUNDING_M if sure else -ROUNDING_M):
            return True
        margin = -GRAZING_M if sure else GRAZING_M
        return not fault.through_walls and self._sightlines.walls(a, b, margin) > 0

    def _wrong(self, link: Link, k: int, entry: Entry, *, stopped: bool) -> None:
        source, to, _ = link
        frame = f"a frame from {self._names.get(source, source)} to {self._names.get(to, to)} of tick {k}"
        says = "was stopped by range {} and within reach" if stopped else "came through range {}"
        self._problem = f"{frame} {says.format(entry.id)}"


def _running(mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Counts of set points below each row, column by column; int64 (h + 1, w)."""
    return np.pad(np.cumsum(mask, axis=0, dtype=np.int64), ((1, 0), (0, 0)))
