"""The verdict's checks of zones, by the polygons and masks themselves instead of the grid."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from patrol.faults.kinds import Drift, Motion
from patrol.journal import RobotTick, Status, TickRecord
from patrol.pose import command_of
from worldsim.verdict.common.check import Check, CheckResult
from worldsim.verdict.common.faults import active
from worldsim.verdict.common.robots_there import RobotsThere
from worldsim.verdict.robots.expected_statuses import ExpectedStatuses

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from patrol.zones.spec import MaskSpec, ZoneSpec
    from worldsim.verdict.common.check import JudgedRun, Readings

SLACK_M = 1e-6
"""Way beyond what a zone allows in a step from which on a robot was too fast, m."""


class ZoneCheck(Check):
    """A check of what robots do in zones of one kind."""

    needs = (RobotsThere, ExpectedStatuses)
    rule: ClassVar[str]  # field of a zone that makes it one of this kind, such as "speed"

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._expected = readings[ExpectedStatuses]
        self._names = run.names
        self._zones = self._zones_of(run)
        self._is_in = {zone.name: _place_test(zone) for zone in self._zones}

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the scenario has such zones."""
        return bool(cls._zones_of(run))

    @classmethod
    def _zones_of(cls, run: JudgedRun) -> list[ZoneSpec]:
        return [zone for zone in run.prepared.scenario.zones if getattr(zone, cls.rule) is not None]


class KeepOutsKept(ZoneCheck):
    """No body's centre is in a keep-out in any tick."""

    name = "keep-outs"
    rule = "keep_out"

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        of_terrain = enumerate(run.prepared.scenario.terrain.keep_out)
        self._is_in |= {f"terrain.keep_out.{n}": partial(is_inside, np.array(polygon)) for n, polygon in of_terrain}
        self._looked = 0

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the scenario keeps bodies out of some ground."""
        return bool(run.prepared.scenario.terrain.keep_out) or super().applies(run)

    def _tick(self, record: TickRecord) -> None:
        for robot in record.robots:
            if robot.number in self._expected.away:
                continue
            self._looked += 1
            inside = [name for name, is_in in self._is_in.items() if is_in(robot.x, robot.y)]
            if inside:
                where = f"at ({robot.x:.3f}, {robot.y:.3f})"
                self._fail(f"{self._names[robot.number]} is in {inside[0]} at tick {record.k}, {where}")

    def _good(self) -> str:
        return f"{self._looked} poses outside of {len(self._is_in)} keep-outs"


class SlowZonesKept(ZoneCheck):
    """No robot that is in a slow zone in force gets farther in a step than the zone's speed allows, by its poses.

    Whether a zone is in force follows from the scenario's times. Under motion faults bodies drive faster than they are
    commanded, so there the command counts.
    """

    name = "slow zones"
    rule = "speed"

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._models = {spec.number: spec.model for spec in run.prepared.scenario.roster}
        self._motions = [entry for entry in run.timeline.entries if isinstance(entry.fault, Motion)]
        self._moving: dict[int, tuple[RobotTick, ZoneSpec]] = {}
        self._looked = 0

    def _tick(self, record: TickRecord) -> None:
        for row in record.robots:
            before, zone = self._moving.pop(row.number, (None, None))
            if before is not None and zone is not None and row.number not in self._expected.appeared:
                self._judge(record.k - 1, row.number, before, zone, math.hypot(row.x - before.x, row.y - before.y))
        disturbed = {number for entry in self._motions if active(entry, record.k) for number in entry.who}
        for row in record.robots:
            zone = self._slowest(row, record.k) if row.status is Status.ALIVE else None
            if zone is None:
                continue
            if row.number in disturbed:
                speed = command_of(self._models[row.number], row.c0, row.c1).speed_mps
                self._judge(record.k, row.number, row, zone, speed * self._run.step)
            else:
                self._moving[row.number] = row, zone

    def _slowest(self, row: RobotTick, k: int) -> ZoneSpec | None:
        """Return the zone in force with the lowest speed among those that a robot is in."""
        there = [zone for zone in self._zones if self._is_in_force(zone, k) and self._is_in[zone.name](row.x, row.y)]
        return min(there, key=lambda zone: zone.speed or 0.0, default=None)

    def _is_in_force(self, zone: ZoneSpec, k: int) -> bool:
        if zone.times is None:
            return True
        begun = [first for first, _ in zone.times if first <= k * self._run.step]
        ended = [end for _, end in zone.times if end <= k * self._run.step]
        return len(begun) > len(ended)

    def _judge(self, k: int, number: int, row: RobotTick, zone: ZoneSpec, way_m: float) -> None:
        self._looked += 1
        assert zone.speed is not None
        if way_m > zone.speed * self._run.step + SLACK_M:
            where = f"({row.x:.3f}, {row.y:.3f})"
            speed = f"{way_m / self._run.step:.3f} m/s in {zone.name}, which allows {zone.speed:g} m/s,"
            self._fail(f"{self._names[number]} drives {speed} at tick {k}, at {where}")

    def _good(self) -> str:
        return f"{self._looked} steps in {len(self._zones)} slow zones, none too fast"


class _Visit(NamedTuple):
    """A robot's stay in a zone."""

    came_in: tuple[float, float]  # x and y where its centre was first seen in the zone, m
    disturbed: bool  # a drift or motion fault acted on it, so it was not where it believed to be


class OneWayZonesKept(ZoneCheck):
    """No robot gets farther against a one-way zone, from where it came in, than is allowed.

    That is its diameter, a step and a point's diagonal.

    It goes by poses. Visits during which a drift or motion fault acts on a robot are counted and not judged.
    """

    name = "one-way zones"
    rule = "one_way"

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        roster = run.prepared.scenario.roster
        rim_m = math.sqrt(2.0) * run.prepared.terrain.point  # robots know zones by points
        self._allowed = {spec.number: 2.0 * spec.radius + spec.speed * run.step + rim_m for spec in roster}
        self._disturbing = [entry for entry in run.timeline.entries if isinstance(entry.fault, Drift | Motion)]
        self._visits: dict[tuple[int, str], _Visit] = {}
        self._count = self._disturbed = 0
        self._farthest_m = 0.0

    def _tick(self, record: TickRecord) -> None:
        disturbed = {n for entry in self._disturbing if active(entry, record.k) for n in entry.who}
        for row in record.robots:
            for zone in self._zones:
                key = row.number, zone.name
                if row.number in self._expected.appeared:
                    self._visits.pop(key, None)
                if row.number in self._expected.away or not self._is_in[zone.name](row.x, row.y):
                    self._visits.pop(key, None)
                    continue
                visit = self._visits.get(key)
                if visit is None:
                    visit = _Visit((row.x, row.y), False)
                    self._count += 1
                if row.number in disturbed and not visit.disturbed:
                    visit = visit._replace(disturbed=True)
                    self._disturbed += 1
                self._visits[key] = visit
                if not visit.disturbed:
                    self._judge(record.k, zone, visit, row)

    def _judge(self, k: int, zone: ZoneSpec, visit: _Visit, row: RobotTick) -> None:
        assert zone.one_way is not None
        angle = math.radians(zone.one_way)
        across, up = visit.came_in[0] - row.x, visit.came_in[1] - row.y
        back_m = across * math.cos(angle) + up * math.sin(angle)
        self._farthest_m = max(self._farthest_m, back_m)
        allowed_m = self._allowed[row.number]
        if back_m > allowed_m:
            where = f"at ({row.x:.3f}, {row.y:.3f})"
            went = f"went {back_m:.3f} m against {zone.name}, where {allowed_m:.3f} m are allowed,"
            self._fail(f"{self._names[row.number]} {went} by tick {k}, {where}")

    def result(self) -> CheckResult:
        """Return the result, as of every check; not judged where a fault acted on the robot in each visit."""
        if self._count and self._disturbed == self._count:
            return self._not_judged(f"not judged: drift or motion faults acted on robots in all {self._count} visits")
        return super().result()

    def _good(self) -> str:
        left_out = f"; {self._disturbed} under drift or motion faults not judged" if self._disturbed else ""
        visits = f"{self._count} visits to {len(self._zones)} one-way zones"
        return f"{visits}, at most {self._farthest_m:.2f} m against them{left_out}"


def _place_test(zone: ZoneSpec) -> Callable[[float, float], bool]:
    """Return a test whether a place, x and y in m, is in a zone, by the zone's polygon or mask."""
    if zone.mask is not None:
        return partial(_is_marked, zone.mask, zone.mask.marked())
    return partial(is_inside, np.array(zone.polygon, dtype=np.float64))


def is_inside(corners: NDArray[np.float64], x: float, y: float) -> bool:
    """Return True for a place inside a polygon, by the even-odd rule.

    `corners` is float64 (n, 2): x and y of each corner, m.
    """
    xs, ys = corners.T
    to_xs, to_ys = np.roll(xs, -1), np.roll(ys, -1)
    crossed = (ys > y) != (to_ys > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        right = x < xs + (y - ys) * (to_xs - xs) / (to_ys - ys)
    return bool(np.count_nonzero(crossed & right) % 2)


def _is_marked(mask: MaskSpec, marked: NDArray[np.bool_], x: float, y: float) -> bool:
    """Return True for a place in a marked cell of a mask."""
    row = math.floor((y - mask.origin[1]) / mask.resolution)
    col = math.floor((x - mask.origin[0]) / mask.resolution)
    return 0 <= row < mask.rows and 0 <= col < mask.columns and bool(marked[row, col])
