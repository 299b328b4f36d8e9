"""The verdict's check of one-way zones."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from patrol.scenario.faults.kinds import Drift, Motion
from worldsim.verdict.common.check import Check, CheckResult
from worldsim.verdict.common.faults import active
from worldsim.verdict.common.robots_there import RobotsThere
from worldsim.verdict.robots.expected_statuses import ExpectedStatuses
from worldsim.verdict.robots.keep_outs import place_test

if TYPE_CHECKING:
    from patrol.journal import RobotTick, TickRecord
    from patrol.scenario import ZoneSpec
    from worldsim.verdict.common.check import JudgedRun, Readings


class _Visit(NamedTuple):
    """A robot's stay in a zone.

    Attributes:
        came_in: x and y where its centre was first seen in it, m.
        disturbed: A drift or motion fault acted on the robot, so it was not where it believed to be.
    """

    came_in: tuple[float, float]
    disturbed: bool


class OneWayZonesKept(Check):
    """No robot gets farther against a one-way zone, from where it came in, than is allowed.

    That is its diameter, a step and a point's diagonal.

    It goes by poses, and by the polygons and masks themselves instead of the grid. Visits during which a drift or
    motion fault acts on a robot are counted and not judged.
    """

    name = "one-way zones"
    needs = (RobotsThere, ExpectedStatuses)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        scenario = run.prepared.scenario
        self._expected = readings[ExpectedStatuses]
        self._names = run.names
        rim_m = math.sqrt(2.0) * run.prepared.terrain.point  # robots know zones by points
        self._allowed = {spec.number: 2.0 * spec.radius + spec.speed * run.step + rim_m for spec in scenario.roster}
        self._zones = [(zone, place_test(zone)) for zone in scenario.zones if zone.one_way is not None]
        self._disturbing = [entry for entry in run.timeline.entries if isinstance(entry.fault, Drift | Motion)]
        self._visits: dict[tuple[int, str], _Visit] = {}
        self._count = self._disturbed = 0
        self._farthest_m = 0.0

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the scenario has one-way zones."""
        return any(zone.one_way is not None for zone in run.prepared.scenario.zones)

    def _tick(self, record: TickRecord) -> None:
        disturbed = {n for entry in self._disturbing if active(entry, record.k) for n in entry.who}
        for row in record.robots:
            for zone, is_in in self._zones:
                key = row.number, zone.name
                if row.number in self._expected.appeared:
                    self._visits.pop(key, None)
                if row.number in self._expected.away or not is_in(row.x, row.y):
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
