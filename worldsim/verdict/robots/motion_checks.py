"""The verdict's check of motion faults: how far bodies got and where to, compared with the faults' numbers.

It does not use `worldsim.robots.noise`, which disturbs the motion, and repeats no draw (the check `moves` does both).
It measures each move from two poses, and judges whether chance explains how often moves were fast, far off, or none.

A move that would end in a wall or another body is cancelled and cannot be measured, and a fast one is cancelled more
often than a slow one. So only moves are judged that nothing could have cancelled, however fast.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

from patrol.faults.kinds import Motion
from patrol.ground.swept_path import free_fraction
from patrol.journal import RobotTick, Status, TickRecord
from patrol.pose import TAU, Command, Drive, Pose, Twist, command_of, is_halt
from worldsim.verdict.common.chance import FAMILY, enough, unexplained
from worldsim.verdict.common.check import Check, CheckResult
from worldsim.verdict.common.faults import active
from worldsim.verdict.common.robots_there import RobotsThere
from worldsim.verdict.robots.expected_statuses import ExpectedStatuses

if TYPE_CHECKING:
    from worldsim.faults import Entry
    from worldsim.verdict.common.check import JudgedRun, Readings

FASTEST = 2.0
"""No motion fault makes a body more than so many times as fast, or turn so many times as much, as asked."""

SURE = 8.0
"""Standard deviations within which all noise of a run lies: beyond them is one draw in 10^15."""

LEAST = 1e-6
"""Noise below this is not told from rounding."""

MEDIAN = 0.6744897501960817
"""Half of all normal draws are within this many standard deviations."""

ALARM = 1e-3 * FAMILY
"""For all counts together: they add next to nothing to the false alarms of the others."""

_HALVES = ("slower or faster by little", "faster than commanded", "off by little", "off to one side")
_NEAR_SPEED, _FAST, _NEAR_TURN, _ONE_SIDE = range(4)

Move = tuple[int, "Entry", RobotTick]
"""A tick, the motion fault, and the robot's row."""


class MotionAsAsked(Check):
    """Bodies drive and turn as unevenly as motion faults ask for, and slip as often.

    Speeds are as often above the commanded as below; bodies turn as often too far as not far enough, or, where they
    veer, to the left as to the right. Half of the errors are as small as half of the draws would be. Moves under
    several motion faults of a robot are not judged here.
    """

    name = "motion"
    needs = (RobotsThere, ExpectedStatuses)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._expected = readings[ExpectedStatuses]
        self._step = run.step
        self._terrain = run.prepared.terrain
        self._specs = {spec.number: spec for spec in run.prepared.scenario.roster}
        self._entries = [entry for entry in run.timeline.entries if isinstance(entry.fault, Motion)]
        self._moves: dict[int, Move] = {}
        self._roomy: set[int] = set()
        self._stretches: dict[tuple[int, int, str], int] = {}
        self._draws, self._hits = [0] * len(_HALVES), [0] * len(_HALVES)
        self._slip_draws: Counter[int] = Counter()
        self._slips: Counter[int] = Counter()
        self._looked = 0

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if a fault acts on bodies' motion."""
        return any(isinstance(entry.fault, Motion) for entry in run.timeline.entries)

    def _tick(self, record: TickRecord) -> None:
        for row in record.robots:
            before = self._moves.pop(row.number, None)
            if before is not None and row.number not in self._expected.appeared | self._expected.away:
                self._look_at_move(before, Pose(row.x, row.y, row.heading))
        now = [entry for entry in self._entries if active(entry, record.k)]
        self._roomy.clear()
        for row in record.robots:
            mine = [entry for entry in now if row.number in entry.who]
            if len(mine) == 1 and row.status is Status.ALIVE and not is_halt(self._command(row)):
                self._moves[row.number] = record.k, mine[0], row
                if self._has_room(row, record.robots, FASTEST ** len(now)):
                    self._roomy.add(row.number)

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in and the journal has ended."""
        self._fail(self._unlikely())
        return super().result()

    def _good(self) -> str:
        return f"{self._looked} moves as uneven as configured"

    def _command(self, row: RobotTick) -> Command:
        return command_of(self._specs[row.number].model, row.c0, row.c1)

    def _has_room(self, row: RobotTick, rows: Sequence[RobotTick], factor: float) -> bool:
        """Return True if nothing can cancel a robot's move, although it and others get so many times as far."""
        step, pose = factor * self._step, Pose(row.x, row.y, row.heading)
        reach = self._specs[row.number].radius + self._command(row).speed_mps * step
        if free_fraction(self._terrain, pose, pose, reach) < 1.0:
            return False
        return all(
            math.hypot(other.x - row.x, other.y - row.y)
            > reach + self._specs[other.number].radius + self._command(other).speed_mps * step
            for other in rows
            if other.number != row.number and other.number not in self._expected.away
        )

    def _look_at_move(self, move: Move, after: Pose) -> None:
        k, entry, row = move
        fault, before = entry.fault, Pose(row.x, row.y, row.heading)
        assert isinstance(fault, Motion)
        self._looked += 1
        stood = after == before and not row.bumped
        if fault.slip is not None and self._is_new("slip", fault.slip.every, move):
            self._slip_draws[entry.index] += 1
            self._slips[entry.index] += stood
        if not stood and row.number in self._roomy:
            self._measure(k, entry, row, fault, after)

    def _measure(self, k: int, entry: Entry, row: RobotTick, fault: Motion, after: Pose) -> None:
        command = self._command(row)
        asked_m = command.speed_mps * self._step
        chord = math.hypot(after.x - row.x, after.y - row.y)
        match command:
            case Twist() | Drive():
                bend = command.turn_rate * self._step if isinstance(command, Twist) else asked_m * command.curvature
                if FASTEST * (FASTEST * abs(bend) + SURE * fault.veer * asked_m) >= math.pi:
                    return  # which way it turned is not told
                turned = math.remainder(after.heading - row.heading, TAU)
                half = 0.5 * turned
                driven_m = chord * (half / math.sin(half) if abs(half) > LEAST else 1.0)
                if isinstance(command, Drive):
                    bend = math.copysign(driven_m, command.speed) * command.curvature
            case _:
                bend, driven_m = 0.0, chord
                if SURE * fault.veer * FASTEST * asked_m >= math.pi:
                    return
                turned = math.remainder(math.atan2(after.y - row.y, after.x - row.x) - math.atan2(row.c1, row.c0), TAU)
        if asked_m > LEAST:
            self._judge_speed(driven_m / asked_m - 1.0, fault, (k, entry, row))
        turning, veer = fault.turning * abs(bend), fault.veer * driven_m
        if max(turning, veer) > LEAST:
            if min(turning, veer) == 0.0:
                self._count(_NEAR_TURN, abs(turned - bend) < MEDIAN * (turning + veer))
            forwards = bend if veer == 0.0 else row.c0 if isinstance(command, Twist | Drive) else 1.0
            self._count(_ONE_SIDE, (turned - bend) * forwards > 0.0)

    def _judge_speed(self, error: float, fault: Motion, move: Move) -> None:
        size = 0.0 if fault.jitter is None else fault.jitter.size
        if max(fault.speed, size) <= LEAST:
            return
        if fault.jitter is not None and not self._is_new("jitter", fault.jitter.every, move):
            return
        if min(fault.speed, size) == 0.0:
            self._count(_NEAR_SPEED, abs(error) < (MEDIAN * fault.speed if size == 0.0 else 0.5 * size))
        self._count(_FAST, error > 0.0)

    def _is_new(self, what: str, every: float | None, move: Move) -> bool:
        """Return True for the first move that shows what was drawn for a stretch of time."""
        k, entry, row = move
        stretch = k if every is None else math.floor((k - entry.begin) * self._step / every + 1e-9)
        known = self._stretches.get((entry.index, row.number, what))
        self._stretches[entry.index, row.number, what] = stretch
        return stretch != known

    def _count(self, what: int, hit: bool) -> None:
        self._draws[what] += 1
        self._hits[what] += hit

    def _unlikely(self) -> str:
        """Describe what chance does not explain of the moves."""
        alarm = ALARM / (len(_HALVES) + len(self._entries))
        for name, draws, hits in zip(_HALVES, self._draws, self._hits, strict=True):
            if enough(draws, 0.5, alarm) and unexplained(hits, draws, 0.5, alarm):
                return f"of {draws} moves {hits} were {name}; half of them are expected"
        for entry in self._entries:
            assert isinstance(entry.fault, Motion)
            rate = 0.0 if entry.fault.slip is None else entry.fault.slip.rate
            draws, hits = self._slip_draws[entry.index], self._slips[entry.index]
            if enough(draws, rate, alarm) and unexplained(hits, draws, rate, alarm):
                return f"of {draws} times {entry.id} let bodies slip in {hits}; expected is a share of {rate:g}"
        return ""
