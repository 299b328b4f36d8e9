"""The verdict's checks of faults of senses, clocks and motion, by what robots are told and places of bodies.

They use neither `worldsim.robots.senses` nor `worldsim.robots.noise`, which make these errors, and repeat no draw (the
check `moves` repeats those of motion). They measure the errors, and judge whether they are as large as asked, and
whether chance explains how often they were small, large, or to one side.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from patrol.faults.kinds import Clock, Drift, Motion
from patrol.ground.swept_path import free_fraction
from patrol.journal import RobotTick, Status, TickRecord
from patrol.journal.records import FORGED
from patrol.pose import TAU, Drive, Pose, Twist, is_halt
from patrol.radio.message import CONTACT, MAX_TIME_MS, Position, Rejected, decode, ms_to_s
from worldsim.checks.check import FAMILY, Check, Series, first_problem
from worldsim.checks.statuses import ExpectedStatuses

if TYPE_CHECKING:
    from worldsim.checks.check import JudgedRun
    from worldsim.faults import Entry

ROUNDED_M = 1e-9
"""Rounding allowed in a place, m along each axis."""

ROUNDED_S = 0.000501
"""Rounding allowed in a frame's time, s."""

SURE = 8.0
"""Standard deviations within which all noise of a run lies: beyond them is one draw in 10^15."""

LEAST = 1e-6
"""Noise below this is not told from rounding."""

FASTEST = 2.0
"""No motion fault makes a body more than so many times as fast, or turn so many times as much, as asked."""

MEDIAN = 0.6744897501960817
"""Half of all normal draws are within this many standard deviations."""

ALARM = 1e-3 * FAMILY
"""For all counts of a check together: they add next to nothing to the false alarms of other checks."""

Place = tuple[float, float]
"""x and y in m."""

Move = tuple[int, "Entry", RobotTick]
"""A tick, the motion fault, and the robot's row."""


def _make_halves(what: str, *named: str) -> list[Series]:
    """Return series of which half of the draws are expected to hit."""
    return [Series(0.5, f"of {{draws}} {what} {{hits}} were {name}", "; half of them are expected") for name in named]


@dataclass(slots=True)
class _Segment:
    """The mean error (m) that one robot reported between two jumps, beyond bias and growth, over `count` ticks."""

    jumps: int
    count: float = 0
    x: float = 0.0
    y: float = 0.0

    def add(self, x: float, y: float) -> None:
        """Add the error of one more tick, m along each axis."""
        self.count += 1
        self.x += (x - self.x) / self.count
        self.y += (y - self.y) / self.count


@dataclass(slots=True)
class _Reports:
    """The reports of one robot under the same drifts."""

    entries: Sequence[Entry]
    noise: float  # the standard deviation (m) along each axis
    size: float  # the length (m) of each jump; 0 where nothing jumps
    now: _Segment
    before: _Segment | None  # the one that ended last; None where it is not known


class SensesAsAsked(Check):
    """Robots are told the places, and report the times, that drifts and clocks ask for, and all others the true ones.

    The error is bias and growth, to the rounding. Noise is as large as configured, and as often to one side as to the
    other. A jump changes the error by its size; between jumps the error stays the same. Where several drifts of a robot
    jump, only that it is told of a place on the terrain is judged; at the terrain's edge, to a point.
    """

    name = "senses"
    kinds = (Drift, Clock)

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._bounds = run.prepared.terrain.bounds
        self._point = run.prepared.terrain.point
        self._reports: dict[int, _Reports] = {}
        along = ("small along x", "small along y", "above zero along x", "above zero along y")
        self._series = _make_halves("draws of noise", *along)

    def _tick(self, record: TickRecord) -> None:
        now = self._active(record.k)
        rows = {row.number: row for row in record.robots}
        localised = {number: Pose(*pose) for number, *pose in record.localised}
        for row in record.robots:
            if row.status is Status.ALIVE:
                mine = [entry for entry in now if row.number in entry.who]
                true = Pose(row.x, row.y, row.heading)
                self._look_at_place(record.k, true, row.number, localised.get(row.number, true), mine)
        for source, frame in record.frames:
            # A forger's frames are judged by their own check.
            if source == FORGED or source not in rows:
                continue
            try:
                report = decode(frame)
            except Rejected:  # the check of frames reports it
                continue
            if report.robot != CONTACT:
                mine = [entry for entry in now if source in entry.who]
                self._looked += bool(mine)
                self._look_at_time(record.k, source, report, mine)

    def _end(self) -> str:
        for number, reports in self._reports.items():
            self._compare_segments(number, reports)
        self._fail(first_problem(self._series, ALARM / len(self._series)))
        return f"{self._looked} frames with the configured errors"

    def _look_at_time(self, k: int, number: int, said: Position, mine: Sequence[Entry]) -> None:
        expected_s = k * self._step
        for entry in mine:
            if isinstance(entry.fault, Clock):
                expected_s += entry.fault.offset + entry.fault.rate * (k - entry.begin) * self._step
        expected_s = min(max(expected_s, 0.0), ms_to_s(MAX_TIME_MS))
        reported_s = ms_to_s(said.time_ms)
        if abs(reported_s - expected_s) > ROUNDED_S:
            self._blame_robot(
                number, f"reports the time {reported_s:g} s in tick {k}, but its clock shows {expected_s:g} s"
            )

    def _look_at_place(self, k: int, true: Pose, number: int, said: Pose, mine: Sequence[Entry]) -> None:
        x_min, y_min, x_max, y_max = self._bounds
        if not (x_min <= said.x <= x_max and y_min <= said.y <= y_max):
            self._blame_robot(number, f"is told in tick {k} of a place off the terrain: ({said.x:.2f}, {said.y:.2f})")
        if said.heading != true.heading:
            self._blame_robot(number, f"is told in tick {k} of the heading {said.heading:g} rad, which is not its own")
        drifts = [(entry, entry.fault) for entry in mine if isinstance(entry.fault, Drift)]
        due_x, due_y, jumps = true.x, true.y, []
        for entry, fault in drifts:
            elapsed_s = (k - entry.begin) * self._step
            due_x += fault.bias[0] + fault.growth[0] * elapsed_s
            due_y += fault.bias[1] + fault.growth[1] * elapsed_s
            if fault.jump is not None:
                # Rounding must not make a jump a tick late.
                jumps.append(math.floor(elapsed_s / fault.jump.every + 1e-9))
        if len(jumps) <= 1:
            reports = self._reports_of(number, drifts, sum(jumps))
            self._compare_place(k, number, reports, (said.x, said.y), (due_x, due_y))

    def _reports_of(self, number: int, drifts: Sequence[tuple[Entry, Drift]], jumps: int) -> _Reports:
        """Return the known error of a robot since its drifts began and since its last jump."""
        reports = self._reports.get(number)
        entries = [entry for entry, _ in drifts]
        if reports is not None and reports.entries == entries:
            if jumps != reports.now.jumps:
                self._compare_segments(number, reports)
                reports.before, reports.now = reports.now if reports.now.count else reports.before, _Segment(jumps)
            return reports
        if reports is not None:
            self._compare_segments(number, reports)
        noise = math.hypot(*(drift.noise for _, drift in drifts))
        size = max((drift.jump.size for _, drift in drifts if drift.jump is not None), default=0.0)
        # Without a jump the error is known exactly, as if it had been measured for ever.
        before = None if jumps else _Segment(0, math.inf)
        self._reports[number] = _Reports(entries, noise, size, _Segment(jumps), before)
        return self._reports[number]

    def _compare_place(self, k: int, number: int, reports: _Reports, said: Place, due: Place) -> None:
        """Compare a place with those since the last jump under the same drifts, and add it to these."""
        # Before any jump the error is bias and growth alone, which are known.
        segment = reports.now if reports.now.jumps else _Segment(0, math.inf)
        if not segment.count:
            if all(self._is_inland(coordinate, axis, 0.0) for axis, coordinate in enumerate(said)):
                reports.now.add(said[0] - due[0], said[1] - due[1])
            return
        expected = due[0] + segment.x, due[1] + segment.y
        # The mean that it is compared with is uncertain as well, by its own share of the noise.
        spread = reports.noise * math.sqrt(1.0 + 1.0 / segment.count)
        margin = 2.0 * ROUNDED_M + SURE * spread
        inland = [self._is_inland(coordinate, axis, margin) for axis, coordinate in enumerate(expected)]
        for axis in (0, 1):
            coordinate = min(max(expected[axis], self._bounds[axis]), self._bounds[axis + 2])
            if abs(said[axis] - coordinate) > margin + (0.0 if inland[axis] else self._point):
                reported, wanted = (f"({x:.2f}, {y:.2f})" for x, y in (said, expected))
                self._blame_robot(number, f"is told of {reported} in tick {k}, but its drift asks for {wanted}")
        if all(inland):
            reports.now.add(said[0] - due[0], said[1] - due[1])
            if reports.noise >= LEAST:
                off = [said[axis] - expected[axis] for axis in (0, 1)]
                hits = [*(abs(error) < MEDIAN * spread for error in off), *(error > 0.0 for error in off)]
                for series, hit in zip(self._series, hits, strict=True):
                    series.add(hit)

    def _is_inland(self, at: float, axis: int, margin: float) -> bool:
        """Return True if a place is so far from the terrain's edge that the world does not move it inland."""
        away = self._point + margin
        return self._bounds[axis] + away <= at <= self._bounds[axis + 2] - away

    def _compare_segments(self, number: int, reports: _Reports) -> None:
        """Compare the mean error of the segment that ends with that of the one before."""
        now, before = reports.now, reports.before
        if before is None or not now.count:
            return
        apart = math.hypot(now.x - before.x, now.y - before.y)
        noise = reports.noise * math.sqrt(1.0 / now.count + 1.0 / before.count)
        # The bound holds along each axis, so lengths may differ by sqrt(2) times as much.
        slack = math.sqrt(2.0) * (2.0 * ROUNDED_M + SURE * noise)
        jumps = now.jumps - before.jumps
        if apart > jumps * reports.size + slack or (jumps == 1 and apart < reports.size - slack):
            jumped = "1 jump" if jumps == 1 else f"{jumps} jumps"
            words = f"reports places {apart:.2f} m apart after {jumped} of {reports.size:g} m"
            self._blame_robot(
                number, words if jumps else f"reports places off by {apart:.2f} m on average beyond its drift"
            )

    def _blame_robot(self, number: int, words: str) -> None:
        self._fail(f"{self._name(number)} {words}")


class MotionAsAsked(Check):
    """Bodies drive and turn as unevenly as motion faults ask for, and slip as often.

    Speeds are as often above the commanded as below; bodies turn as often too far as not far enough, or, where they
    veer, to the left as to the right. Half of the errors are as small as half of the draws would be. Moves under
    several motion faults of a robot are not judged here.

    A move that would end in a wall or another body is cancelled and cannot be measured, and a fast one is cancelled
    more often than a slow one. So only moves are measured that nothing could have cancelled, however fast.
    """

    name = "motion"
    kinds = (Motion,)

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._expected = run.reading(ExpectedStatuses)
        self._terrain = run.prepared.terrain
        self._moves: dict[int, Move] = {}
        self._roomy: set[int] = set()
        self._stretches: dict[tuple[int, int, str], int] = {}
        named = ("slower or faster by little", "faster than commanded", "off by little", "off to one side")
        self._series = _make_halves("moves", *named)
        self._near_speed, self._fast, self._near_turn, self._one_side = self._series
        self._slips: dict[int, Series] = {}
        for entry in self._entries:
            rate = entry.fault.slip.rate if isinstance(entry.fault, Motion) and entry.fault.slip else 0.0
            words = f"of {{draws}} times {entry.id} let bodies slip in {{hits}}"
            self._slips[entry.index] = Series(rate, words, f"; expected is a share of {rate:g}")

    def _tick(self, record: TickRecord) -> None:
        for row in record.robots:
            before = self._moves.pop(row.number, None)
            if before is not None and row.number not in self._expected.appeared | self._expected.away:
                self._look_at_move(before, Pose(row.x, row.y, row.heading))
        now = self._active(record.k)
        self._roomy.clear()
        for row in record.robots:
            mine = [entry for entry in now if row.number in entry.who]
            if len(mine) == 1 and row.status is Status.ALIVE and not is_halt(self._run.command(row)):
                self._moves[row.number] = record.k, mine[0], row
                # Other robots may be under all motion faults at once.
                if self._has_room(row, record.robots, FASTEST ** len(now)):
                    self._roomy.add(row.number)

    def _end(self) -> str:
        series = [*self._series, *self._slips.values()]
        self._fail(first_problem(series, ALARM / len(series)))
        return f"{self._looked} moves as uneven as configured"

    def _has_room(self, row: RobotTick, rows: Sequence[RobotTick], factor: float) -> bool:
        """Return True if nothing can cancel a robot's move, although it and others get so many times as far."""
        time_s, pose = factor * self._step, Pose(row.x, row.y, row.heading)
        reach_m = self._specs[row.number].radius + self._run.command(row).speed_mps * time_s
        if free_fraction(self._terrain, pose, pose, reach_m) < 1.0:
            return False
        return all(
            math.hypot(neighbour.x - row.x, neighbour.y - row.y)
            > reach_m + self._specs[neighbour.number].radius + self._run.command(neighbour).speed_mps * time_s
            for neighbour in rows
            if neighbour.number != row.number and neighbour.number not in self._expected.away
        )

    def _look_at_move(self, move: Move, after: Pose) -> None:
        _, entry, row = move
        fault, before = entry.fault, Pose(row.x, row.y, row.heading)
        assert isinstance(fault, Motion)
        self._looked += 1
        stood = after == before and not row.bumped
        if fault.slip is not None and self._is_new("slip", fault.slip.every, move):
            self._slips[entry.index].add(stood)
        if not stood and row.number in self._roomy:
            self._measure_move(move, fault, after)

    def _measure_move(self, move: Move, fault: Motion, after: Pose) -> None:
        row = move[2]
        command = self._run.command(row)
        asked_m = command.speed_mps * self._step
        chord_m = math.hypot(after.x - row.x, after.y - row.y)
        match command:
            case Twist() | Drive():
                bend = command.turn_rate * self._step if isinstance(command, Twist) else asked_m * command.curvature
                if FASTEST * (FASTEST * abs(bend) + SURE * fault.veer * asked_m) >= math.pi:
                    return  # which way it turned is not told
                turned = math.remainder(after.heading - row.heading, TAU)
                half = 0.5 * turned
                # An arc is longer than its chord.
                driven_m = chord_m * (half / math.sin(half) if abs(half) > LEAST else 1.0)
                if isinstance(command, Drive):
                    bend = math.copysign(driven_m, command.speed) * command.curvature
            case _:
                bend, driven_m = 0.0, chord_m
                if SURE * fault.veer * FASTEST * asked_m >= math.pi:
                    return
                turned = math.remainder(math.atan2(after.y - row.y, after.x - row.x) - math.atan2(row.c1, row.c0), TAU)
        if asked_m > LEAST:
            self._judge_speed(driven_m / asked_m - 1.0, fault, move)
        turning, veer = fault.turning * abs(bend), fault.veer * driven_m
        if max(turning, veer) > LEAST:
            if min(turning, veer) == 0.0:
                self._near_turn.add(abs(turned - bend) < MEDIAN * (turning + veer))
            forwards = bend if veer == 0.0 else row.c0 if isinstance(command, Twist | Drive) else 1.0
            self._one_side.add((turned - bend) * forwards > 0.0)

    def _judge_speed(self, error: float, fault: Motion, move: Move) -> None:
        size = 0.0 if fault.jitter is None else fault.jitter.size
        if max(fault.speed, size) <= LEAST:
            return
        if fault.jitter is not None and not self._is_new("jitter", fault.jitter.every, move):
            return
        if min(fault.speed, size) == 0.0:
            self._near_speed.add(abs(error) < (MEDIAN * fault.speed if size == 0.0 else 0.5 * size))
        self._fast.add(error > 0.0)

    def _is_new(self, what: str, every: float | None, move: Move) -> bool:
        """Return True for the first move that shows the draw for a stretch of time."""
        k, entry, row = move
        stretch = k if every is None else math.floor((k - entry.begin) * self._step / every + 1e-9)
        previous = self._stretches.get((entry.index, row.number, what))
        self._stretches[entry.index, row.number, what] = stretch
        return stretch != previous
