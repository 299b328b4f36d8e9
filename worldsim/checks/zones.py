"""The verdict's checks of zones, by the polygons and masks themselves instead of the grid."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from patrol.faults.kinds import Motion
from patrol.journal import RobotTick, Status, TickRecord
from patrol.journal.records import IN_FORCE, OUT_OF_FORCE
from worldsim.checks.check import Check, robots_hit
from worldsim.checks.places import is_inside, is_within
from worldsim.checks.statuses import ExpectedStatuses

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from patrol.zones.spec import MaskSpec, ZoneSpec
    from worldsim.checks.check import JudgedRun

SLACK_M = 1e-6
"""Way beyond what a zone allows in a step from which on a robot was too fast, m."""


class ZoneCheck(Check):
    """A check of the moves of robots in zones of one kind."""

    rule: ClassVar[str]  # field of a zone that makes it one of this kind, such as "speed"

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._expected = run.reading(ExpectedStatuses)
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

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        of_terrain = enumerate(run.prepared.scenario.terrain.keep_out)
        self._is_in |= {f"terrain.keep_out.{n}": partial(is_inside, np.array(polygon)) for n, polygon in of_terrain}

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
                self._fail(f"{self._name(robot.number)} is in {inside[0]} at tick {record.k}, {where}")

    def _end(self) -> str:
        return f"{self._looked} poses outside of {len(self._is_in)} keep-outs"


class SlowZonesKept(ZoneCheck):
    """No robot that is in a slow zone in force gets farther in a step than the zone's speed allows, by its poses.

    Whether a zone is in force follows from the scenario's times. Under motion faults bodies drive faster than they are
    commanded, so there the command counts.
    """

    name = "slow zones"
    rule = "speed"

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._motions = run.entries(Motion)
        self._moving: dict[int, tuple[RobotTick, ZoneSpec]] = {}

    def _tick(self, record: TickRecord) -> None:
        for row in record.robots:
            before, zone = self._moving.pop(row.number, (None, None))
            if before is not None and zone is not None and row.number not in self._expected.appeared:
                self._judge_zone(record.k - 1, before, zone, math.hypot(row.x - before.x, row.y - before.y))
        disturbed = robots_hit(self._motions, record.k)
        for row in record.robots:
            zone = self._find_slowest(row, record.k * self._step) if row.status is Status.ALIVE else None
            if zone is None:
                continue
            if row.number in disturbed:
                speed = self._run.command(row).speed_mps
                self._judge_zone(record.k, row, zone, speed * self._step)
            else:
                # The next tick's pose says how far it gets.
                self._moving[row.number] = row, zone

    def _find_slowest(self, row: RobotTick, time_s: float) -> ZoneSpec | None:
        """Return the zone in force with the lowest speed among those that a robot is in."""
        in_force = (zone for zone in self._zones if zone.times is None or is_within(zone.times, time_s))
        zones = [zone for zone in in_force if self._is_in[zone.name](row.x, row.y)]
        return min(zones, key=lambda zone: zone.speed or 0.0, default=None)

    def _judge_zone(self, k: int, row: RobotTick, zone: ZoneSpec, way_m: float) -> None:
        self._looked += 1
        assert zone.speed is not None
        if way_m > zone.speed * self._step + SLACK_M:
            where = f"({row.x:.3f}, {row.y:.3f})"
            speed = f"{way_m / self._step:.3f} m/s in {zone.name}, which allows {zone.speed:g} m/s,"
            self._fail(f"{self._name(row.number)} drives {speed} at tick {k}, at {where}")

    def _end(self) -> str:
        return f"{self._looked} steps in {len(self._zones)} slow zones, none too fast"


class ZoneTimesTold(Check):
    """The journal has an event in each tick before which a zone begins or ends, and no other.

    Whether a zone is in force is recomputed from the scenario's times, with the operators' switching.
    """

    name = "zone times"
    needs_no_robots = True

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        zones = run.prepared.scenario.zones
        self._times = {zone.name: zone.times for zone in zones if zone.times is not None}
        self._held: set[str] = set()
        self._changes = 0

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if some zone has times, of the scenario or by a switch."""
        return any(zone.times is not None for zone in run.prepared.scenario.zones)

    def _tick(self, record: TickRecord) -> None:
        k, kinds = record.k, (IN_FORCE, OUT_OF_FORCE)
        in_journal = [(event.detail, event.kind) for event in self._events_before(k) if event.kind in kinds]
        in_force = {name for name, times in self._times.items() if is_within(times, k * self._step)}
        # At tick 0 nothing has changed yet, so zones that are in force from the beginning have no event.
        turned = in_force ^ self._held if k else set()
        wanted = [(name, IN_FORCE if name in in_force else OUT_OF_FORCE) for name in self._times if name in turned]
        for name, kind in wanted:
            if (name, kind) not in in_journal:
                self._fail(f"{name} is {kind} from tick {k} on, and the journal has no event of it")
        for name, kind in in_journal:
            if in_journal.count((name, kind)) > 1 or (name, kind) not in wanted:
                self._fail(f"the journal has {name} {kind} from tick {k} on, when nothing changes")
        self._held, self._changes = in_force, self._changes + len(in_journal)

    def _end(self) -> str:
        return f"{len(self._times)} zones with times, which began or ended {self._changes} times, as asked"


def _place_test(zone: ZoneSpec) -> Callable[[float, float], bool]:
    """Return a test whether a place, x and y in m, is in a zone, by the zone's polygon or mask."""
    if zone.mask is not None:
        return partial(_is_marked, zone.mask, zone.mask.marked())
    return partial(is_inside, np.array(zone.polygon, dtype=np.float64))


def _is_marked(mask: MaskSpec, marked: NDArray[np.bool_], x: float, y: float) -> bool:
    """Return True for a place in a marked cell of a mask."""
    row = math.floor((y - mask.origin[1]) / mask.resolution)
    col = math.floor((x - mask.origin[0]) / mask.resolution)
    return 0 <= row < mask.rows and 0 <= col < mask.columns and bool(marked[row, col])
