"""The verdict's check of slow zones."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from patrol.journal import RobotTick, Status, TickRecord
from patrol.pose import command_of
from patrol.scenario.faults.kinds import Motion
from worldsim.verdict.common.check import Check
from worldsim.verdict.common.faults import active
from worldsim.verdict.common.robots_there import RobotsThere
from worldsim.verdict.robots.expected_statuses import ExpectedStatuses
from worldsim.verdict.robots.keep_outs import place_test

if TYPE_CHECKING:
    from patrol.scenario import ZoneSpec
    from worldsim.verdict.common.check import JudgedRun, Readings

SLACK_M = 1e-6
"""Way beyond what a zone allows in a step from which on a robot was too fast, m."""


class SlowZonesKept(Check):
    """No robot that is in a slow zone in force gets farther in a step than the zone's speed allows, by its poses.

    Where it is follows from the polygons and masks themselves instead of the grid, and whether a zone is in force from
    the scenario's times. Under motion faults bodies drive faster than they are commanded, so there the command counts.
    """

    name = "slow zones"
    needs = (RobotsThere, ExpectedStatuses)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        scenario = run.prepared.scenario
        self._expected = readings[ExpectedStatuses]
        self._names = run.names
        self._models = {spec.number: spec.model for spec in scenario.roster}
        self._slow = [zone for zone in scenario.zones if zone.speed is not None]
        self._is_in = {zone.name: place_test(zone) for zone in self._slow}
        self._motions = [entry for entry in run.timeline.entries if isinstance(entry.fault, Motion)]
        self._moving: dict[int, tuple[RobotTick, ZoneSpec]] = {}
        self._looked = 0

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the scenario has slow zones."""
        return any(zone.speed is not None for zone in run.prepared.scenario.zones)

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
        there = [zone for zone in self._slow if self._is_in_force(zone, k) and self._is_in[zone.name](row.x, row.y)]
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
        return f"{self._looked} steps in {len(self._slow)} slow zones, none too fast"
