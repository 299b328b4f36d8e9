"""The verdict's check of drifts and clocks: what robots report of place and time, compared with the faults' numbers.

It does not use `worldsim.robots.senses`, which makes these errors, and repeats no draw: where noise or jumps are drawn
it judges how large they are, and whether chance explains the noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from patrol.faults.kinds import Clock, Drift
from patrol.journal import RobotTick, TickRecord
from patrol.journal.records import FORGED
from patrol.pose import TAU
from patrol.radio.message import CONTACT, MAX_TIME_MS, Position, Rejected, decode
from patrol.radio.units import cm_to_m, mrad_to_rad, ms_to_s
from worldsim.verdict.common.chance import FAMILY, enough, unexplained
from worldsim.verdict.common.check import Check, CheckResult
from worldsim.verdict.common.faults import active
from worldsim.verdict.common.robots_there import RobotsThere

if TYPE_CHECKING:
    from worldsim.faults import Entry
    from worldsim.verdict.common.check import JudgedRun, Readings

ROUNDED_M = 0.00501
ROUNDED_S = 0.000501
ROUNDED_RAD = 0.001
"""Rounding allowed in a frame's place (m, along each axis), time (s) and heading."""

SURE = 8.0
"""Standard deviations within which all noise of a run lies: beyond them is one draw in 10^15."""

COARSE_M = 0.05
"""Noise from which on rounding to centimetres does not change the shares of small and large draws that are counted."""

MEDIAN = 0.6744897501960817
"""Half of all normal draws are within this many standard deviations."""

ALARM = 1e-3 * FAMILY
"""For all counts of noise together: they add next to nothing to the false alarms of the others."""

Place = tuple[float, float]
"""x and y in m."""

_COUNTS = ("small along x", "small along y", "above zero along x", "above zero along y")


@dataclass(slots=True)
class _Segment:
    """The mean error (m) that one robot reported between two jumps, beyond bias and growth, over `count` ticks."""

    jumps: int
    count: float = 0
    x: float = 0.0
    y: float = 0.0

    def add(self, x: float, y: float) -> None:
        """One more tick."""
        self.count += 1
        self.x += (x - self.x) / self.count
        self.y += (y - self.y) / self.count


@dataclass(slots=True)
class _Reports:
    """The reports of one robot under the same drifts. before: the segment that ended last, if one is known."""

    drifts: tuple[Drift, ...]
    now: _Segment
    before: _Segment | None

    @property
    def noise(self) -> float:
        """The standard deviation (m) along each axis."""
        return math.hypot(*(drift.noise for drift in self.drifts))

    @property
    def size(self) -> float:
        """The length (m) of each jump; 0 where nothing jumps."""
        return max((drift.jump.size for drift in self.drifts if drift.jump is not None), default=0.0)


class SensesAsAsked(Check):
    """Robots report the places and the times that drifts and clocks ask for, and all others the true ones.

    The error is bias and growth, to the rounding. With noise it is as large as configured, and in no direction more
    than in another; it is the same between jumps, and differs by the jump's size from one jump to the next. Where
    several drifts of a robot jump, only that it reports a place on the terrain is judged; at the terrain's edge, to a
    point.
    """

    name = "senses"
    needs = (RobotsThere,)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._names = run.names
        self._step = run.step
        self._bounds = run.prepared.terrain.bounds
        self._point = run.prepared.terrain.point
        self._entries = [entry for entry in run.timeline.entries if isinstance(entry.fault, Drift | Clock)]
        self._reports: dict[int, tuple[tuple[Entry, ...], _Reports]] = {}
        self._hits = [0] * len(_COUNTS)
        self._draws = self._looked = 0

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if a fault makes robots wrong about place or time."""
        return any(isinstance(entry.fault, Drift | Clock) for entry in run.timeline.entries)

    def _tick(self, record: TickRecord) -> None:
        now = [entry for entry in self._entries if active(entry, record.k)]
        rows = {row.number: row for row in record.robots}
        for source, frame in record.frames:
            if source == FORGED or source not in rows:
                continue
            try:
                said = decode(frame)
            except Rejected:  # the check of frames reports it
                continue
            if said.robot != CONTACT:
                mine = [entry for entry in now if source in entry.who]
                self._looked += bool(mine)
                self._look_at_time(record.k, source, said, mine)
                self._look_at_place(record.k, rows[source], said, mine)

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in and the journal has ended."""
        for number, (_, reports) in self._reports.items():
            self._compare(number, reports)
        self._fail(self._unlikely())
        return super().result()

    def _good(self) -> str:
        return f"{self._looked} frames with the configured errors"

    def _look_at_time(self, k: int, number: int, said: Position, mine: Sequence[Entry]) -> None:
        due = k * self._step
        for entry in mine:
            if isinstance(entry.fault, Clock):
                due += entry.fault.offset + entry.fault.rate * (k - entry.begin) * self._step
        due = min(max(due, 0.0), ms_to_s(MAX_TIME_MS))
        if abs(ms_to_s(said.time_ms) - due) > ROUNDED_S:
            reported_s = ms_to_s(said.time_ms)
            self._blame(number, f"reports the time {reported_s:g} s in tick {k}, but its clock shows {due:g} s")

    def _look_at_place(self, k: int, row: RobotTick, said: Position, mine: Sequence[Entry]) -> None:
        x, y = cm_to_m(said.x_cm), cm_to_m(said.y_cm)
        x_min, y_min, x_max, y_max = self._bounds
        if not (x_min <= x <= x_max and y_min <= y <= y_max):
            self._blame(row.number, f"reports in tick {k} a place off the terrain: ({x:.2f}, {y:.2f})")
        if abs(math.remainder(mrad_to_rad(said.heading_mrad) - row.heading, TAU)) > ROUNDED_RAD:
            self._blame(row.number, f"reports in tick {k} a heading of {said.heading_mrad} mrad, which is not its own")
        entries = tuple(entry for entry in mine if isinstance(entry.fault, Drift))
        due_x, due_y, jumps = row.x, row.y, []
        for entry in entries:
            assert isinstance(entry.fault, Drift)
            elapsed = (k - entry.begin) * self._step
            due_x += entry.fault.bias[0] + entry.fault.growth[0] * elapsed
            due_y += entry.fault.bias[1] + entry.fault.growth[1] * elapsed
            if entry.fault.jump is not None:
                jumps.append(math.floor(elapsed / entry.fault.jump.every + 1e-9))
        if len(jumps) <= 1:
            reports = self._reports_of(row.number, entries, sum(jumps))
            self._hold(k, row.number, reports, (x, y), (due_x, due_y))

    def _reports_of(self, number: int, entries: tuple[Entry, ...], jumps: int) -> _Reports:
        """Return the known error of a robot since its drifts began and since its last jump."""
        drifts, reports = self._reports.get(number, ((), None))
        if reports is None or drifts != entries:
            if reports is not None:
                self._compare(number, reports)
            before = None if jumps else _Segment(0, math.inf)
            faults = tuple(entry.fault for entry in entries if isinstance(entry.fault, Drift))
            reports = _Reports(faults, _Segment(jumps), before)
            self._reports[number] = entries, reports
        elif jumps != reports.now.jumps:
            self._compare(number, reports)
            reports.before, reports.now = reports.now if reports.now.count else reports.before, _Segment(jumps)
        return reports

    def _hold(self, k: int, number: int, reports: _Reports, said: Place, due: Place) -> None:
        """Compare a place with those since the last jump under the same drifts, and add it to these."""
        known = reports.now if reports.now.jumps else _Segment(0, math.inf)
        if not known.count:
            if all(self._inland(at, axis, 0.0) for axis, at in enumerate(said)):
                reports.now.add(said[0] - due[0], said[1] - due[1])
            return
        expected = due[0] + known.x, due[1] + known.y
        spread = reports.noise * math.sqrt(1.0 + 1.0 / known.count)
        margin = 2.0 * ROUNDED_M + SURE * spread
        inland = [self._inland(at, axis, margin) for axis, at in enumerate(expected)]
        for axis in (0, 1):
            at = min(max(expected[axis], self._bounds[axis]), self._bounds[axis + 2])
            if abs(said[axis] - at) > margin + (0.0 if inland[axis] else self._point):
                place, asked = (f"({x:.2f}, {y:.2f})" for x, y in (said, expected))
                self._blame(number, f"reports the place {place} in tick {k}, but its drift asks for {asked}")
        if all(inland):
            reports.now.add(said[0] - due[0], said[1] - due[1])
            if reports.noise >= COARSE_M:
                off = [said[axis] - expected[axis] for axis in (0, 1)]
                self._draws += 1
                hits = [*(abs(error) < MEDIAN * spread for error in off), *(error > 0.0 for error in off)]
                self._hits = [count + hit for count, hit in zip(self._hits, hits, strict=True)]

    def _inland(self, at: float, axis: int, margin: float) -> bool:
        """Return True if a place is so far from the terrain's edge that the world does not move it inland."""
        away = self._point + margin
        return self._bounds[axis] + away <= at <= self._bounds[axis + 2] - away

    def _compare(self, number: int, reports: _Reports) -> None:
        """Compare the mean error of the segment that ends with that of the one before."""
        now, before = reports.now, reports.before
        if before is None or not now.count:
            return
        apart = math.hypot(now.x - before.x, now.y - before.y)
        noise = reports.noise * math.sqrt(1.0 / now.count + 1.0 / before.count)
        slack = math.sqrt(2.0) * (2.0 * ROUNDED_M + SURE * noise)
        jumps = now.jumps - before.jumps
        if apart > jumps * reports.size + slack or (jumps == 1 and apart < reports.size - slack):
            jumped = "1 jump" if jumps == 1 else f"{jumps} jumps"
            words = f"reports places {apart:.2f} m apart after {jumped} of {reports.size:g} m"
            self._blame(number, words if jumps else f"reports places off by {apart:.2f} m on average beyond its drift")

    def _unlikely(self) -> str:
        """Describe what chance does not explain of the noise."""
        alarm = ALARM / len(_COUNTS)
        for name, hits in zip(_COUNTS, self._hits, strict=True):
            if enough(self._draws, 0.5, alarm) and unexplained(hits, self._draws, 0.5, alarm):
                return f"of {self._draws} draws of noise {hits} were {name}; half of them are expected"
        return ""

    def _blame(self, number: int, words: str) -> None:
        self._fail(f"{self._names[number]} {words}")
