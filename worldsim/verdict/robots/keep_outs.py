"""The verdict's check of keep-outs."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from worldsim.verdict.common.check import Check
from worldsim.verdict.common.robots_there import RobotsThere
from worldsim.verdict.robots.expected_statuses import ExpectedStatuses

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from patrol.journal import TickRecord
    from patrol.scenario.zones import MaskSpec, ZoneSpec
    from worldsim.verdict.common.check import JudgedRun, Readings


class KeepOutsKept(Check):
    """No body's centre is in a keep-out in any tick, by the polygons and masks themselves instead of the grid."""

    name = "keep-outs"
    needs = (RobotsThere, ExpectedStatuses)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        scenario = run.prepared.scenario
        self._expected = readings[ExpectedStatuses]
        self._names = run.names
        kept = [zone for zone in scenario.zones if zone.keep_out]
        polygons = {f"terrain.keep_out.{n}": polygon for n, polygon in enumerate(scenario.terrain.keep_out)}
        polygons |= {zone.name: zone.polygon for zone in kept if zone.polygon is not None}
        self._polygons = {name: np.array(polygon, dtype=np.float64) for name, polygon in polygons.items()}
        self._masks = {zone.name: (zone.mask, zone.mask.marked()) for zone in kept if zone.mask is not None}
        self._looked = 0

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the scenario keeps bodies out of some ground."""
        scenario = run.prepared.scenario
        return bool(scenario.terrain.keep_out) or any(zone.keep_out for zone in scenario.zones)

    def _tick(self, record: TickRecord) -> None:
        for robot in record.robots:
            if robot.number in self._expected.away:
                continue
            self._looked += 1
            inside = [name for name, corners in self._polygons.items() if is_inside(corners, robot.x, robot.y)]
            inside += [name for name, mask in self._masks.items() if is_marked(*mask, robot.x, robot.y)]
            if inside:
                where = f"at ({robot.x:.3f}, {robot.y:.3f})"
                self._fail(f"{self._names[robot.number]} is in {inside[0]} at tick {record.k}, {where}")

    def _good(self) -> str:
        return f"{self._looked} poses outside of {len(self._polygons) + len(self._masks)} keep-outs"


def place_test(zone: ZoneSpec) -> Callable[[float, float], bool]:
    """Return what tells by x and y in m whether a place is in a zone, by its polygon or mask.

    Args:
        zone: The zone.
    """
    if zone.mask is not None:
        return partial(is_marked, zone.mask, zone.mask.marked())
    return partial(is_inside, np.array(zone.polygon, dtype=np.float64))


def is_inside(corners: NDArray[np.float64], x: float, y: float) -> bool:
    """Return True for a place inside of a polygon, by the even-odd rule.

    Args:
        corners: float64 (n, 2), x and y of each corner, m.
        x: Of the place, m.
        y: Of the place, m.
    """
    xs, ys = corners.T
    to_xs, to_ys = np.roll(xs, -1), np.roll(ys, -1)
    crossed = (ys > y) != (to_ys > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        right = x < xs + (y - ys) * (to_xs - xs) / (to_ys - ys)
    return bool(np.count_nonzero(crossed & right) % 2)


def is_marked(mask: MaskSpec, marked: NDArray[np.bool_], x: float, y: float) -> bool:
    """Return True for a place in a marked cell of a mask.

    Args:
        mask: The mask.
        marked: Its marked cells, bool (rows, columns).
        x: Of the place, m.
        y: Of the place, m.
    """
    row = math.floor((y - mask.origin[1]) / mask.resolution)
    col = math.floor((x - mask.origin[0]) / mask.resolution)
    return 0 <= row < mask.rows and 0 <= col < mask.columns and bool(marked[row, col])
