"""The verdict's check of drifts and clocks: what robots say of place and time, held against the faults' own numbers.

It knows nothing of `worldsim.senses`, which told the robots, and reads no draw again: where noise or jumps are drawn it
judges how large they are, and whether chance explains the noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from patrol.journal import RobotTick, TickRecord
from patrol.journal.records import FORGED
from patrol.pose import TAU
from patrol.radio.message import CONTACT, MAX_TIME_MS, Position, Rejected, decode
from patrol.scenario.faults.kinds import Clock, Drift
from worldsim.verdict.chance import FAMILY, enough, unexplained
from worldsim.verdict.checks import Check, names_of
from worldsim.verdict.frames.airborne import active

if TYPE_CHECKING:
    from patrol.prepare import Prepared
    from worldsim.run_record import RunRecord
    from worldsim.timeline import Entry, Timeline

ROUNDED_M = 0.00501
ROUNDED_S = 0.000501
ROUNDED_RAD = 0.001
"""By how much a frame's place (m, along each axis), time (s) and heading may be off what was rounded."""

SURE = 8.0
"""Standard deviations within which all noise of a run lies: beyond them is one draw in 10^15."""

COARSE_M = 0.05
"""Noise from which on rounding to centimetres does not change the shares of small and large draws that are counted."""

MEDIAN = 0.6744897501960817
"""Half of all normal draws are within so many standard deviations."""

ALARM = 1e-3 * FAMILY
"""For all counts of noise together: they add next to nothing to the false alarms of the others."""

Place = tuple[float, float]
"""x and y in m."""

_COUNTS = ("small along x", "small along y", "above zero along x", "above zero along y")


@dataclass(slots=True)
class _Segment:
    """The mean error (m) that one robot was told between two jumps, besides bias and growth; count: of ticks."""

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
class _Told:
    """What one robot is told while the same drifts befall it; before: the segment that ended last, if one is known."""

    drifts: tuple[Drift, ...]
    now: _Segment
    before: _Segment | None

    @property
    def noise(self) -> float:
        """The standard deviation (m) along each axis."""
        return math.hypot(*(drift.noise for drift in self.drifts))

    @property
    def size(self) -> float:
        """How far (m) each jump leads; 0 where nothing jumps."""
        return max((drift.jump.size for drift in self.drifts if drift.jump is not None), default=0.0)


class SensesAsAsked:
    """Robots are told the places and the times that drifts and clocks ask for, and all others the true ones.

    Off by bias and growth, to the rounding; with noise as large as asked for, and in no direction more than in another;
    between jumps by the same, and from one jump to the next by its size. Where several drifts of a robot jump, only
    that it lies on the terrain is judged; at the terrain's edge, to a point.
    """

    def __init__(self, journal: RunRecord, prepared: Prepared, timeline: Timeline) -> None:
        self._names = names_of(journal)
        self._step = prepared.scenario.step
        self._bounds = prepared.terrain.bounds
        self._point = prepared.terrain.point
        self._entries = [entry for entry in timeline.entries if isinstance(entry.fault, Drift | Clock)]
        self._told: dict[int, tuple[tuple[Entry, ...], _Told]] = {}
        self._hits = [0] * len(_COUNTS)
        self._draws = self._looked = 0
        self._problem = ""

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        now = [entry for entry in self._entries if active(entry, record.k)]
        rows = {row.number: row for row in record.robots}
        for source, frame in () if self._problem else record.frames:
            if source == FORGED or source not in rows:
                continue
            try:
                said = decode(frame)
            except Rejected:  # another check's business
                continue
            if said.robot != CONTACT:
                mine = [entry for entry in now if source in entry.who]
                self._looked += bool(mine)
                self._look_at_time(record.k, source, said, mine)
                self._look_at_place(record.k, rows[source], said, mine)

    def check(self) -> Check:
        """The result, once all ticks are in."""
        for number, (_, told) in self._told.items():
            self._compare(number, told)
        problem = self._problem or self._unlikely()
        return Check("senses", not problem, problem or f"{self._looked} frames with senses as wrong as asked for")

    def _look_at_time(self, k: int, number: int, said: Position, mine: Sequence[Entry]) -> None:
        due = k * self._step
        for entry in mine:
            if isinstance(entry.fault, Clock):
                due += entry.fault.offset + entry.fault.rate * (k - entry.begin) * self._step
        due = min(max(due, 0.0), MAX_TIME_MS / 1000.0)
        if abs(said.time_ms / 1000.0 - due) > ROUNDED_S:
            self._blame(number, f"says in tick {k} that it is {said.time_ms / 1000.0:g} s, its clock shows {due:g} s")

    def _look_at_place(self, k: int, row: RobotTick, said: Position, mine: Sequence[Entry]) -> None:
        x, y = said.x_cm / 100.0, said.y_cm / 100.0
        x_min, y_min, x_max, y_max = self._bounds
        if not (x_min <= x <= x_max and y_min <= y <= y_max):
            self._blame(row.number, f"is told in tick {k} that it is off the terrain, at ({x:.2f}, {y:.2f})")
        if abs(math.remainder(said.heading_mrad / 1000.0 - row.heading, TAU)) > ROUNDED_RAD:
            self._blame(row.number, f"is told in tick {k} a heading of {said.heading_mrad} mrad, which is not its own")
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
            told = self._told_by(row.number, entries, sum(jumps))
            self._hold(k, row.number, told, (x, y), (due_x, due_y))

    def _told_by(self, number: int, entries: tuple[Entry, ...], jumps: int) -> _Told:
        """What is known of a robot's error since its drifts began and since its last jump."""
        drifts, told = self._told.get(number, ((), None))
        if told is None or drifts != entries:
            if told is not None:
                self._compare(number, told)
            before = None if jumps else _Segment(0, math.inf)
            faults = tuple(entry.fault for entry in entries if isinstance(entry.fault, Drift))
            told = _Told(faults, _Segment(jumps), before)
            self._told[number] = entries, told
        elif jumps != told.now.jumps:
            self._compare(number, told)
            told.before, told.now = told.now if told.now.count else told.before, _Segment(jumps)
        return told

    def _hold(self, k: int, number: int, told: _Told, said: Place, due: Place) -> None:
        """Hold a place against what the same drifts have made of places since the last jump, and add it to that."""
        known = told.now if told.now.jumps else _Segment(0, math.inf)
        if not known.count:
            if all(self._inland(at, axis, 0.0) for axis, at in enumerate(said)):
                told.now.add(said[0] - due[0], said[1] - due[1])
            return
        expected = due[0] + known.x, due[1] + known.y
        spread = told.noise * math.sqrt(1.0 + 1.0 / known.count)
        margin = 2.0 * ROUNDED_M + SURE * spread
        inland = [self._inland(at, axis, margin) for axis, at in enumerate(expected)]
        for axis in (0, 1):
            at = min(max(expected[axis], self._bounds[axis]), self._bounds[axis + 2])
            if abs(said[axis] - at) > margin + (0.0 if inland[axis] else self._point):
                asked = f"({expected[0]:.2f}, {expected[1]:.2f})"
                self._blame(number, f"is told in tick {k} ({said[0]:.2f}, {said[1]:.2f}), its drift asks for {asked}")
        if all(inland):
            told.now.add(said[0] - due[0], said[1] - due[1])
            if told.noise >= COARSE_M:
                off = [said[axis] - expected[axis] for axis in (0, 1)]
                self._draws += 1
                hits = [*(abs(error) < MEDIAN * spread for error in off), *(error > 0.0 for error in off)]
                self._hits = [count + hit for count, hit in zip(self._hits, hits, strict=True)]

    def _inland(self, at: float, axis: int, margin: float) -> bool:
        """Whether a place is so far from the terrain's edge that it is told as it is."""
        away = self._point + margin
        return self._bounds[axis] + away <= at <= self._bounds[axis + 2] - away

    def _compare(self, number: int, told: _Told) -> None:
        """Hold the mean error of the segment that ends against that of the one before."""
        now, before = told.now, told.before
        if before is None or not now.count:
            return
        apart = math.hypot(now.x - before.x, now.y - before.y)
        noise = told.noise * math.sqrt(1.0 / now.count + 1.0 / before.count)
        slack = math.sqrt(2.0) * (2.0 * ROUNDED_M + SURE * noise)
        jumps = now.jumps - before.jumps
        if apart > jumps * told.size + slack or (jumps == 1 and apart < told.size - slack):
            words = f"is told places {apart:.2f} m apart by {jumps} jumps of {told.size:g} m"
            self._blame(
                number, words if jumps else f"is told places off by {apart:.2f} m on average, besides its drift"
            )

    def _unlikely(self) -> str:
        """What chance does not explain of the noise."""
        alarm = ALARM / len(_COUNTS)
        for name, hits in zip(_COUNTS, self._hits, strict=True):
            if enough(self._draws, 0.5, alarm) and unexplained(hits, self._draws, 0.5, alarm):
                return f"of {self._draws} draws of noise {hits} were {name}, half of them should be"
        return ""

    def _blame(self, number: int, words: str) -> None:
        self._problem = self._problem or f"{self._names[number]} {words}"
