"""The verdict's checks of how far the radio reaches: the fault `range` and the model `path-loss`, by true places.

The formulas of path loss are those of `worldsim/radio/path_loss.py`, computed a second time link by link, without its
code and kernels. Where a line grazes a wall it is not sure whether the wall is crossed, and so the powers are not:
everything is computed as the least and the greatest that it can be, and a frame is judged where both lead to the same.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.faults.kinds import Range
from patrol.random import Purpose, draw, gauss
from patrol.scenario.radio_spec import PATH_LOSS, PathLossRadio
from worldsim.checks.check import NO_ROBOT, Check
from worldsim.checks.fates import causes_before, fates, fault_of, kind_of, origins_of
from worldsim.kernels.verdict import crossings, touched

if TYPE_CHECKING:
    from patrol.ground.terrain import Terrain
    from patrol.journal.records import TickRecord
    from worldsim.checks.check import JudgedRun
    from worldsim.faults import Entry
    from worldsim.radio.ether import Link

ROUNDING_M = 1e-9
"""Distances that are this near to the reach count as within and as beyond it, m."""

GRAZING_M = 1e-5
"""A line that passes a wall's corner this closely may or may not count as a line of sight, m."""

ROUNDING_DB = 1e-6
"""Margins are this much less and more sure than computed, dB."""

_DIAGONAL = 1e-6
"""Lines whose sides differ by less are as steep as a diagonal, points: they may be cut into columns or rows."""

_BEFORE_RANGE = causes_before(Range)
"""Causes that stop a frame before its reach matters."""

_SHADOWING, _MOMENT, _RECEPTION = range(3)
"""Purposes of draws, after the seed and `Purpose.RADIO`: (window, sender, receiver), (source, sequence), (source,
receiver, sequence)."""

Place = tuple[float, float]

Span = tuple[float, float]
"""The least and the greatest that a number can be."""


class Sightlines:
    """Counts walls on lines, from running sums along each column and each row of the terrain."""

    def __init__(self, terrain: Terrain) -> None:
        opaque = ~terrain.passable
        self._origin = terrain.origin
        self._point = terrain.point
        self._sums = tuple(_sum_columns(mask) for mask in (opaque, opaque.T))

    def walls(self, a: Place, b: Place, margin: float) -> int:
        """Count the points of wall that a line touches.

        `margin` is how much the line is widened or, where negative, narrowed, m.
        """
        sums, ends = self._find_cuts(a, b)[0]
        return int(touched(sums, *ends, margin / self._point).sum())

    def crossings(self, a: Place, b: Place) -> tuple[int, int]:
        """Return the least and the greatest number of walls that a line crosses, however thick they are.

        For example, (1, 2) for a line that crosses one wall and grazes the corner of another.

        The line is cut into columns, or into rows where it is steeper than its diagonals. A wall is an unbroken stretch
        of these in which the line touches points of wall. One in which the line only grazes them may count or not.
        """
        counts = [crossings(sums, *ends, GRAZING_M / self._point) for sums, ends in self._find_cuts(a, b)]
        return min(lowest for lowest, _ in counts), max(greatest for _, greatest in counts)

    def _find_cuts(self, a: Place, b: Place) -> list[tuple[NDArray[np.int64], tuple[float, float, float, float]]]:
        """Return running sums and the ends in points; a line that is nearly a diagonal may be cut both ways.

        For example, a line from (0, 0) to (4, 1) points is cut into columns, and one from (0, 0) to (1, 4) into rows.
        """
        ends = ([(end[axis] - self._origin[axis]) / self._point for axis in (0, 1)] for end in (a, b))
        (x0, y0), (x1, y1) = ends
        by_column, by_row = self._sums
        steeper = abs(y1 - y0) - abs(x1 - x0)
        cuts = [(by_column, (x0, y0, x1, y1)), (by_row, (y0, x0, y1, x1))]
        return cuts if abs(steeper) < _DIAGONAL else cuts[1:] if steeper > 0.0 else cuts[:1]


def _sum_columns(mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Count the set points below each row, column by column; int64 (h + 1, w)."""
    return np.ascontiguousarray(np.pad(np.cumsum(mask, axis=0, dtype=np.int64), ((1, 0), (0, 0))))


class WithinReach(Check):
    """Frames that passed a `range` were within reach and, where walls count, in sight when they were sent.

    Frames that one stopped were not.
    """

    name = "reach"
    kinds = (Range,)
    of_ether = True

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._sightlines = Sightlines(run.prepared.terrain)
        self._stopped = 0

    def _tick(self, record: TickRecord) -> None:
        entries = self._active(record.k)
        places = {row.number: (row.x, row.y) for row in record.robots}
        for origin, link, why in fates(record, self._run.forgers) if entries else ():
            kind = kind_of(why)
            if kind in _BEFORE_RANGE or origin == NO_ROBOT:
                continue
            stopped = kind == "range"
            self._stopped += stopped
            for entry in entries:
                if origin not in entry.who or (stopped and entry.id != fault_of(why)):
                    continue
                if self._out_of_reach(entry, places[origin], places[link[1]], sure=not stopped) is not stopped:
                    problem = f"got through range {entry.id}"
                    if stopped:
                        problem = f"was stopped by range {entry.id} although it was within reach"
                    self._fail(f"a frame {self._way(link)} of tick {record.k} {problem}")
                    return

    def _end(self) -> str:
        return f"{self._stopped} frames were out of reach, and no other was stopped"

    def _out_of_reach(self, entry: Entry, a: Place, b: Place, *, sure: bool) -> bool:
        """Return True if b is out of reach from a: for sure, or as far as rounding can tell."""
        fault = entry.fault
        assert isinstance(fault, Range)
        if math.dist(a, b) > fault.reach + (ROUNDING_M if sure else -ROUNDING_M):
            return True
        # Narrowed, it touches only walls that are in the way for sure.
        margin = -GRAZING_M if sure else GRAZING_M
        return not fault.through_walls and self._sightlines.walls(a, b, margin) > 0


class PathLossAsAsked(Check):
    """Frames that got through were received by the model's formula and draws, and frames that it lost were not."""

    name = "path loss"
    of_ether = True

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        radio = run.prepared.scenario.radio
        assert isinstance(radio, PathLossRadio)
        self._options = radio.options
        self._seed = run.prepared.scenario.seed
        self._sightlines = Sightlines(run.prepared.terrain)
        self._shadowing: dict[tuple[int, int], float] = {}
        self._places: dict[int, Place] = {}
        self._powers: dict[tuple[int, int], Span] = {}
        self._window = self._lost = self._judged = 0

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the world carried frames by this model."""
        return super().applies(run) and run.prepared.scenario.radio.model == PATH_LOSS

    def _tick(self, record: TickRecord) -> None:
        self._places = {row.number: (row.x, row.y) for row in record.robots}
        self._powers = {}
        redraw = self._options.redraw
        # The margin: 165 steps of 0.1 s by a redraw of 1.1 s give a little less than 15 in binary.
        window = 0 if redraw is None else math.floor(record.k * self._step / redraw + 1e-9)
        if window != self._window:
            self._window = window
            self._shadowing.clear()
        through = [
            (origin, link, why)
            for origin, link, why in fates(record, self._run.forgers)
            if origin != NO_ROBOT and why in ("", PATH_LOSS)
        ]
        disturbs = self._find_disturbing(record, [link for _, link, _ in through])
        for origin, link, why in through:
            lowest, greatest = self._find_margin_db(origin, link[1], disturbs.get(link, []))
            drawn = draw(self._seed, Purpose.RADIO, _RECEPTION, *link)
            self._lost += why == PATH_LOSS
            self._judged += 1
            problem = ""
            if why == PATH_LOSS and drawn < self._find_probability(lowest - ROUNDING_DB):
                problem = "was lost by path loss and should have been received"
            elif not why and drawn >= self._find_probability(greatest + ROUNDING_DB):
                problem = "got through and should have been lost by path loss"
            if problem:
                self._fail(f"a frame {self._way(link)} of tick {record.k} {problem}")

    def _end(self) -> str:
        return f"{self._lost} of {self._judged} frames were lost by path loss, as recomputed"

    def _find_disturbing(self, record: TickRecord, through: list[Link]) -> dict[Link, list[int]]:
        """Find the robots whose frames overlap a frame at a receiver; the receiver itself where it was sending."""
        airtime = self._options.airtime
        if airtime == 0.0:
            return {}
        begins = {
            (source, sequence): (self._step * draw(self._seed, Purpose.RADIO, _MOMENT, source, sequence), origin)
            for (source, sequence), origin in origins_of(record, self._run.forgers).items()
        }
        reached: dict[tuple[int, int], set[int]] = {}
        for source, to, sequence in through:
            reached.setdefault((source, sequence), set()).add(to)
        by_moment = sorted((*begins[frame], frame) for frame in reached)
        overlapping: dict[tuple[int, int], list[tuple[int, tuple[int, int]]]] = {}
        for index, (moment, origin, frame) in enumerate(by_moment):
            for next_moment, later_origin, following in by_moment[index + 1 :]:
                # Sorted by their moments: no later frame overlaps this one either.
                if next_moment - moment >= airtime:
                    break
                if origin != later_origin:
                    overlapping.setdefault(frame, []).append((later_origin, following))
                    overlapping.setdefault(following, []).append((origin, frame))
        return {
            (source, to, sequence): [
                later_origin
                for later_origin, frame in overlapping[source, sequence]
                if later_origin == to or to in reached[frame]
            ]
            for source, to, sequence in through
            if (source, sequence) in overlapping
        }

    def _find_margin_db(self, origin: int, to: int, disturbing: list[int]) -> Span:
        """Return by how much a receiver has more than it needs, dB."""
        options = self._options
        needs = options.sensitivity - options.noise
        noise = 10.0 ** (options.noise / 10.0)
        powers = [self._find_power_dbm(disturber, to) for disturber in disturbing]
        loud = [noise + math.fsum(10.0 ** (power[side] / 10.0) for power in powers) for side in (0, 1)]
        lowest, greatest = self._find_power_dbm(origin, to)
        return lowest - 10.0 * math.log10(loud[1]) - needs, greatest - 10.0 * math.log10(loud[0]) - needs

    def _find_power_dbm(self, origin: int, to: int) -> Span:
        """Return the power that a robot receives from another, dBm; its own is the sending power."""
        options = self._options
        if origin == to:
            return options.power, options.power
        if (origin, to) not in self._powers:
            a, b = self._places[origin], self._places[to]
            clear = options.power - options.reference - 10.0 * options.exponent * math.log10(max(math.dist(a, b), 1.0))
            walls = self._sightlines.crossings(a, b) if options.wall > 0.0 else (0, 0)
            # Shadowing differs by direction, while walls and distance do not, so one sightline serves both.
            for link in ((origin, to), (to, origin)):
                if link not in self._shadowing:
                    self._shadowing[link] = gauss(self._seed, Purpose.RADIO, _SHADOWING, self._window, *link)
                level = clear - options.shadowing * self._shadowing[link]
                self._powers[link] = level - options.wall * walls[1], level - options.wall * walls[0]
        return self._powers[origin, to]

    def _find_probability(self, margin: float) -> float:
        """Return the probability with which a frame is received.

        For example, 0.5 with a margin of 0 dB.
        """
        edge = self._options.edge
        if edge == 0.0:
            return float(margin >= 0.0)
        # The same curve as 1 / (1 + exp(-x)), which would overflow for a large negative margin.
        return 0.5 * (1.0 + math.tanh(0.5 * margin / edge))
