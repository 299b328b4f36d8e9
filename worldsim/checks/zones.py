"""The verdict's checks of zones and closures, by the polygons and masks themselves instead of the grid."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from patrol.closures.ground import IN_IT, WAITING, WAITS, closure_of
from patrol.faults.kinds import Close, Motion, OnClosure
from patrol.journal import RobotTick, Status, TickRecord
from patrol.journal.records import CLOSED, IN_FORCE, OPENED, OUT_OF_FORCE, STAYS_OPEN
from patrol.random import Purpose, draw
from worldsim.checks.check import Check, active, robots_hit
from worldsim.checks.ground import ClosedGround
from worldsim.checks.statuses import ExpectedStatuses

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from patrol.journal import Event
    from patrol.scenario import ClosureSpec
    from patrol.zones.spec import MaskSpec, ZoneSpec
    from worldsim.checks.check import JudgedRun

SLACK_M = 1e-6
"""Way beyond what a zone allows in a step from which on a robot was too fast, and depth in a closure from which on a
body is in it, m."""


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


class ClosuresKept(Check):
    """No body is in a closure that is closed, by its polygon, and each closes and opens when it is to.

    The times are recomputed from the scenario and its faults, operators' included. A closure may close later than it is
    to as long as a body is in its way: no farther from the polygon than its radius and the diagonal of a point, by
    which the closed points may reach beyond the polygon. Each change of a closure is one event.
    """

    name = "closures"

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        scenario = run.prepared.scenario
        self._expected = run.reading(ExpectedStatuses)
        self._ground = run.reading(ClosedGround)
        self._closed = self._ground.closed
        self._closures = scenario.closures
        self._corners = {spec.name: np.array(spec.polygon, dtype=np.float64) for spec in scenario.closures}
        self._diagonal = math.sqrt(2.0) * scenario.point
        self._by_draws = [False] * len(self._closures)
        self._faults = [(entry, entry.fault) for entry in run.timeline.entries if isinstance(entry.fault, OnClosure)]
        self._was_closed: set[str] = set()
        self._was_waiting: set[str] = set()
        self._turns = self._ticks = 0

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the scenario has closures."""
        return bool(run.prepared.scenario.closures)

    def _tick(self, record: TickRecord) -> None:
        here = [robot for robot in record.robots if robot.number not in self._expected.away]
        self._ticks += 1
        for number, spec in enumerate(self._closures):
            wanted = self._is_wanted(number, spec, record.k)
            is_closed = spec.name in self._closed.names
            self._turns += is_closed != (spec.name in self._was_closed)
            if is_closed and not wanted:
                self._fail(f"{spec.name} is closed at tick {record.k}, when it is to be open")
            waits_for: list[RobotTick] = []
            if wanted and not is_closed:
                waits_for = [robot for robot in here if self._measure_depth(robot, spec.name) > -self._diagonal]
                if spec.name in self._was_closed or not waits_for:
                    self._fail(f"{spec.name} is open at tick {record.k}, when it is to be closed and nobody is in it")
            if is_closed:
                for robot in here:
                    if self._measure_depth(robot, spec.name) > SLACK_M:
                        where = f"({robot.x:.3f}, {robot.y:.3f})"
                        name = self._name(robot.number)
                        self._fail(f"{name} is in {spec.name} at tick {record.k}, which is closed, at {where}")
            self._check_events(spec.name, record.k, is_closed, waits_for)
        self._was_closed, self._was_waiting = set(self._closed.names), set(self._closed.waiting)

    def _check_events(self, name: str, k: int, is_closed: bool, waits_for: Sequence[RobotTick]) -> None:
        """Check that the events of a closure before a tick are those that its change calls for."""
        events = [event for event in self._ground.closure_events if closure_of(event) == name]
        was_closed, was_waiting = name in self._was_closed, name in self._was_waiting
        if is_closed != was_closed:
            expected_kind = CLOSED if is_closed else OPENED
        elif bool(waits_for) != was_waiting:
            expected_kind = WAITING if waits_for else STAYS_OPEN
        else:
            expected_kind = ""
        if [event.kind for event in events] != [expected_kind] * bool(expected_kind):
            kinds = " and ".join(event.kind for event in events) or "nothing"
            self._fail(
                f"before tick {k} the journal has {kinds} of {name}, and should have {expected_kind or 'nothing'}"
            )
        elif expected_kind == WAITING and not self._names_robots_inside(events[0], name, waits_for):
            self._fail(f"before tick {k}, {events[0].detail}: these are not the robots that stand there")

    def _names_robots_inside(self, event: Event, name: str, near: Sequence[RobotTick]) -> bool:
        """Return True if an event names all robots in a closure, and no others but near ones, in their order."""
        listed = event.detail.removeprefix(f"{name}{WAITS}").removesuffix(IN_IT).split(", ")
        named = [robot for robot in near if self._name(robot.number) in listed]
        return (
            bool(named)
            and event.detail == f"{name}{WAITS}{', '.join(self._name(robot.number) for robot in named)}{IN_IT}"
            and event.robot == named[0].number
            and all(robot in named for robot in near if self._measure_depth(robot, name) > SLACK_M)
        )

    def _measure_depth(self, robot: RobotTick, name: str) -> float:
        """Return how far a body reaches into a closure, m."""
        return self._specs[robot.number].radius - _measure_gap(self._corners[name], robot)

    def _is_wanted(self, number: int, spec: ClosureSpec, k: int) -> bool:
        rate = (spec.opens if self._by_draws[number] else spec.closes) or 0.0
        drawn = draw(self._run.prepared.scenario.seed, Purpose.CLOSURE, number, k)
        self._by_draws[number] ^= 1.0 - drawn > math.exp(-rate * self._step)
        in_force = [(e.begin, e.index, f) for e, f in self._faults if active(e, k) and f.closure == spec.name]
        if in_force:
            return isinstance(max(in_force)[-1], Close)
        return self._by_draws[number] if spec.closed is None else is_within(spec.closed, k * self._step)

    def _end(self) -> str:
        return f"{len(self._closures)} closures closed or opened {self._turns} times in {self._ticks} ticks, as asked"


def is_within(spans: Sequence[tuple[float, float]], time_s: float) -> bool:
    """Return True if one of the spans of time has begun and not ended."""
    return sum(first <= time_s for first, _ in spans) > sum(end <= time_s for _, end in spans)


def _measure_gap(corners: NDArray[np.float64], robot: RobotTick) -> float:
    """Return the distance of a body's centre from a polygon, m; 0 inside."""
    if is_inside(corners, robot.x, robot.y):
        return 0.0
    here = np.array((robot.x, robot.y))
    side = np.roll(corners, -1, axis=0) - corners
    square = np.maximum((side**2).sum(axis=1), 1e-18)
    share = np.clip(((here - corners) * side).sum(axis=1) / square, 0.0, 1.0)
    return float(np.hypot(*(corners + share[:, None] * side - here).T).min())


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
