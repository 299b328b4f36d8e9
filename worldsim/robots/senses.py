"""The poses and times that robots' senses report, under drift and clock faults.

Bodies are not affected: the world moves them, and keeps the true fog, by their true poses.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from patrol.faults.kinds import Clock, Drift
from patrol.pose import TAU, Pose
from patrol.radio.message import MAX_TIME_MS, ms_to_s
from patrol.random import Purpose, draw, gauss

if TYPE_CHECKING:
    from patrol.ground.terrain import Terrain
    from patrol.scenario import Scenario
    from worldsim.faults import Entry, Timeline

_NOISE, _JUMP = 0, 1


class Senses:
    """The poses and clocks that phase A gives robots: functions of the timeline, the tick and the true pose alone.

    Several drifts of one robot add up, and so do several clock faults. A localiser knows its map, so these poses never
    lie off the terrain; and no clock shows less than zero or more than a message can hold.
    """

    def __init__(self, scenario: Scenario, timeline: Timeline, terrain: Terrain) -> None:
        self.timeline = timeline
        self._seed = scenario.seed
        self._step = scenario.step
        x_min, y_min, x_max, y_max = terrain.bounds
        half = 0.5 * terrain.point
        self._x_limits = x_min + half, x_max - half
        self._y_limits = y_min + half, y_max - half
        self._jumps: dict[tuple[int, int], list[tuple[float, float]]] = {}

    def pose(self, number: int, k: int, true: Pose) -> Pose:
        """Return the pose that a robot's senses report."""
        x, y, wrong = true.x, true.y, False
        for entry in self.timeline.at(k):
            if isinstance(entry.fault, Drift) and number in entry.who:
                dx, dy = self._pose_error(entry, entry.fault, number, k)
                x, y, wrong = x + dx, y + dy, True
        # To the bit: clipping would move a body that stands within half a point of the edge.
        if not wrong:
            return true
        return Pose(_clip_value(x, self._x_limits), _clip_value(y, self._y_limits), true.heading)

    def clock(self, number: int, k: int) -> float:
        """Return the time that a robot's clock shows, s.

        For example, 103 s at 100 s of a run, with an offset of 2 s and a rate of 0.01 since its beginning.
        """
        time_s = k * self._step
        ahead = 0.0
        for entry in self.timeline.at(k):
            if isinstance(entry.fault, Clock) and number in entry.who:
                ahead += entry.fault.offset + entry.fault.rate * (k - entry.begin) * self._step
        return _clip_value(time_s + ahead, (0.0, ms_to_s(MAX_TIME_MS))) if ahead else time_s

    def _pose_error(self, entry: Entry, fault: Drift, number: int, k: int) -> tuple[float, float]:
        elapsed = (k - entry.begin) * self._step
        dx, dy = (bias + growth * elapsed for bias, growth in zip(fault.bias, fault.growth, strict=True))
        if fault.noise > 0.0:
            dx += fault.noise * gauss(self._seed, Purpose.SENSES, entry.index, number, k, _NOISE, 0)
            dy += fault.noise * gauss(self._seed, Purpose.SENSES, entry.index, number, k, _NOISE, 1)
        if fault.jump is not None:
            jumped = self._sum_jumps(entry, number, math.floor(elapsed / fault.jump.every + 1e-9), fault.jump.size)
            dx, dy = dx + jumped[0], dy + jumped[1]
        return dx, dy

    def _sum_jumps(self, entry: Entry, number: int, times: int, size: float) -> tuple[float, float]:
        """Return the sum of the first `times` jumps, added up in their order, m."""
        sums = self._jumps.setdefault((entry.index, number), [(0.0, 0.0)])
        while len(sums) <= times:
            bearing = TAU * draw(self._seed, Purpose.SENSES, entry.index, number, len(sums), _JUMP)
            x, y = sums[-1]
            # Kept: jumps add up, and each tick asks for their sum.
            sums.append((x + size * math.cos(bearing), y + size * math.sin(bearing)))
        return sums[times]


def _clip_value(value: float, limits: tuple[float, float]) -> float:
    return min(max(value, limits[0]), limits[1])
