"""The verdict's checks of bodies: their places, their moves, and the charge of their batteries."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.faults.kinds import Motion
from patrol.ground.swept_path import advance, free_fraction, path_is_free
from patrol.journal import RobotTick, Status, TickRecord
from patrol.pose import Command, Pose, is_halt
from patrol.prepare import sensor_footprint
from worldsim.checks.check import Check, robots_hit
from worldsim.checks.ground import ClosedGround
from worldsim.checks.statuses import ExpectedStatuses
from worldsim.kernels.verdict import first_overlap
from worldsim.robots.noise import MotionNoise

if TYPE_CHECKING:
    from patrol.scenario import RobotSpec
    from worldsim.checks.check import JudgedRun

SLACK = 1e-6
"""Depth (m) of a body in a wall or another body from which on a check calls it an overlap."""

BUMPS_A_MINUTE = 0.5
LEAST_BUMPS = 5
"""A robot bumps often if its moves are cancelled more often than this, and at least so many times in the run.

The rate lies between the two columns of bumps in docs/results/swaps.md, a minute and robot: at most 0.25 where robots
keep right (one row: 0.7), and 0.5 to 10 in the same patrols before they did (one row: 0). The least number spares a
short run the warning for a single meeting in a door, which may cost a few bumps.
"""

NOTHING_J = 1e-3
"""Largest charge of a battery that counts as empty, J."""

DIGITS = 6
"""Decimals of a distance to a dock, m: the last bit of a distance does not decide which of two robots is nearer."""

_ON = (Status.ALIVE, Status.PAUSED)


class BodiesApart(Check):
    """No body that is there is over a wall or overlaps another in any tick, recomputed from the poses."""

    name = "bodies apart"

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._expected = run.reading(ExpectedStatuses)
        self._ground = run.reading(ClosedGround)

    def _tick(self, record: TickRecord) -> None:
        here = [robot for robot in record.robots if robot.number not in self._expected.away]
        self._looked += len(here)
        places = np.array([(robot.x, robot.y) for robot in here], dtype=np.float64).reshape(-1, 2)
        radii = [self._specs[robot.number].radius for robot in here]
        # In the order of x, so that only neighbours along it are compared.
        i, j = first_overlap(places, np.array(radii, dtype=np.float64), np.argsort(places[:, 0]), SLACK)
        if i < len(here):
            pair = f"{self._name(here[i].number)} and {self._name(here[j].number)}"
            apart_m = math.dist(places[i], places[j])
            self._fail(f"{pair} overlap at tick {record.k}, centres {apart_m:.3f} m apart")
        terrain = self._ground.terrain
        for robot, radius in zip(here, radii, strict=True):
            pose = Pose(robot.x, robot.y, robot.heading)
            # Less than the radius by a slack, so that touching a wall is no overlap.
            # A move of no length: free unless the body overlaps a wall where it stands.
            if free_fraction(terrain, pose, pose, max(radius - SLACK, 0.0)) < 1.0:
                where = f"({robot.x:.3f}, {robot.y:.3f})"
                self._fail(f"{self._name(robot.number)} is over a wall at tick {record.k}, at {where}")

    def _end(self) -> str:
        return f"{self._looked} poses clear of each other and of walls"


class MovesAreTrue(Check):
    """Each body goes from its start where its commands take it, to the bit, and they are within its limits.

    Where the sensor does not look all round, a holonomic one may face anywhere after a move: a journal does not say
    where it was told to face.

    Under motion faults it goes where commands and draws take it; the check `motion` judges these draws. Without one it
    does exactly as it is commanded.

    A body without a driver, or whose move was cancelled, stays exactly where it is; one that was away comes back at
    its start. A move that was not cancelled touches no wall. For one that was cancelled there is a wall in its way, or
    another body so near that the two could have met; whether they would have met is not recomputed.
    """

    name = "moves"

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._expected = run.reading(ExpectedStatuses)
        self._ground = run.reading(ClosedGround)
        self._noise = MotionNoise(run.prepared.scenario, run.timeline)
        self._uneven = run.entries(Motion)
        self._due = dict(run.starts)
        self._looks_aside = not sensor_footprint(run.prepared.scenario, run.prepared.terrain).all_round
        self._may_turn: dict[int, bool] = {}  # robots that may face anywhere at the next tick

    def _tick(self, record: TickRecord) -> None:
        for number in self._expected.appeared:
            self._due[number] = self._run.starts[number]
        commands = {row.number: self._run.command(row) for row in record.robots}
        uneven = robots_hit(self._uneven, record.k)
        # Draws count for robots under a motion fault alone; all others must obey exactly.
        driven = commands | {n: to for n, to in self._noise.driven(record.k, commands).items() if n in uneven}
        for row in record.robots:
            spec, pose = self._specs[row.number], Pose(row.x, row.y, row.heading)
            problem = self._problem_of(row, spec, pose, commands[row.number])
            problem = problem or self._problem_of_cancelling(row, pose, driven, record.robots)
            if problem:
                self._fail(f"{spec.name} {problem} at tick {record.k}")
                return
            moves = not row.bumped and not is_halt(driven[row.number])
            # The next tick's poses are compared with these.
            self._due[row.number] = advance(pose, driven[row.number], self._step) if moves else pose
            self._may_turn[row.number] = (
                self._looks_aside and spec.model == "holonomic" and row.status is Status.ALIVE and not row.bumped
            )
            self._looked += 1

    def _end(self) -> str:
        return f"{self._looked} poses follow from the commands"

    def _problem_of_cancelling(
        self, row: RobotTick, pose: Pose, driven: Mapping[int, Command], rows: Sequence[RobotTick]
    ) -> str:
        """Describe the error of a move that was cancelled without reason, or wrongly not cancelled."""
        radius, far_m = self._specs[row.number].radius, driven[row.number].speed_mps * self._step
        if far_m <= 0.0:
            return "has a cancelled move although it does not drive" if row.bumped else ""
        free = path_is_free(self._ground.terrain, pose, driven[row.number], self._step, radius)
        if not row.bumped:
            return "" if free else "drives through a wall"
        if not free:
            return ""
        for neighbour in rows:
            if neighbour.number == row.number or neighbour.number in self._expected.away:
                continue
            other_far_m = driven[neighbour.number].speed_mps * self._step
            reach_m = radius + self._specs[neighbour.number].radius + far_m + other_far_m
            # Both may have driven as far as they could, at most.
            if math.hypot(neighbour.x - row.x, neighbour.y - row.y) <= reach_m + SLACK:
                return ""
        return "has a cancelled move although neither a wall nor another body was in its way,"

    def _problem_of(self, row: RobotTick, spec: RobotSpec, pose: Pose, command: Command) -> str:
        expected = self._due[row.number]
        if self._may_turn.get(row.number):
            expected = replace(expected, heading=pose.heading)
        # To the bit: both sides are computed by the same code from the same numbers.
        if pose != expected:
            return f"is at {_format_pose(pose)} and not at {_format_pose(expected)}, where its last move ended,"
        if row.status is not Status.ALIVE and (not is_halt(command) or row.bumped):
            return f"is {row.status.name.lower()} and drives"
        if row.refused and (row.c0 != 0.0 or row.c1 != 0.0):
            return "drives although its command was refused"
        within = command.is_within(spec.limits)
        return "" if within else f"obeys {command}, which is beyond its limits,"


def _format_pose(pose: Pose) -> str:
    return f"({pose.x!r}, {pose.y!r}; {pose.heading!r} rad)"


class BumpsRare(Check):
    """Warns of robots that bump often.

    A world lets no bodies overlap, so the run's numbers are right; but the robots would have touched each other, or a
    wall, at the speed at which they drove. So this check fails no run.
    """

    name = "bumps"
    needs_no_robots = True

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._alive: Counter[int] = Counter()
        self._bumps: Counter[int] = Counter()

    def _tick(self, record: TickRecord) -> None:
        self._alive.update(row.number for row in record.robots if row.status is Status.ALIVE)
        self._bumps.update(row.number for row in record.robots if row.bumped)

    def _end(self) -> str:
        often = []
        for number, name in self._run.names.items():
            bumps, minutes = self._bumps[number], self._alive[number] * self._step / 60.0
            if bumps >= LEAST_BUMPS and bumps > BUMPS_A_MINUTE * minutes:
                often.append(f"{name} {bumps / minutes:.1f} a minute, {bumps} times in all")
        if not often:
            return f"{self._bumps.total()} moves were cancelled"
        self._warnings = [f"robots bumped often, so that moves were cancelled: {'; '.join(often)}"]
        return self._warnings[0]


class BatteriesLast(Check):
    """A robot drives only while there is charge in its battery; one whose battery gets empty is named.

    That a battery gets empty is no error of the run: its numbers are right, and the robot stands from then on. So it is
    a warning. The charge is recomputed from commands and places without `patrol.energy`, by which the world keeps it.
    """

    name = "batteries"

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        scenario = run.prepared.scenario
        self._places = np.array([dock.place for dock in scenario.docks], dtype=np.float64).reshape(-1, 2)
        self._reaches = np.array([dock.radius for dock in scenario.docks], dtype=np.float64)
        batteries = {number: spec.battery for number, spec in run.specs.items() if spec.battery is not None}
        self._numbers, kinds = list(batteries), list(batteries.values())
        self._capacity = np.array([3600.0 * kind.capacity for kind in kinds])
        self._first = np.array([kind.start for kind in kinds]) * self._capacity
        self._per_s = np.array([kind.idle for kind in kinds])
        self._per_m = np.array([kind.drive for kind in kinds])
        self._gained_per_s = np.array([kind.charge for kind in kinds])
        self._left = self._first.copy()
        self._least = self._left / self._capacity
        self._was_on: NDArray[np.bool_] | None = None
        self._empty: dict[int, int] = {}

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if a robot has a battery."""
        return any(spec.battery is not None for spec in run.prepared.scenario.roster)

    def _tick(self, record: TickRecord) -> None:
        by_number = {row.number: row for row in record.robots}
        rows = [by_number[number] for number in self._numbers]
        is_on = np.array([row.status in _ON for row in rows])
        if self._was_on is not None:
            returned = is_on & ~self._was_on
            # Its process began anew, and so does its charge.
            self._left[returned] = self._first[returned]
        self._was_on = is_on
        ways = np.array([self._way_of(row) for row in rows])
        for wrong in np.flatnonzero((ways > 0.0) & is_on & (self._left < NOTHING_J)):
            self._fail(f"{self._name(self._numbers[wrong])} drives at tick {record.k} although its battery is empty")
        change = np.where(is_on, -self._per_s * self._step - self._per_m * ways, 0.0)
        for index in self._find_charging(rows, is_on & (ways == 0.0)):
            change[index] += self._gained_per_s[index] * self._step
        before, self._left = self._left, np.minimum(self._left + change, self._capacity)
        self._left[self._left < NOTHING_J] = 0.0
        self._least = np.minimum(self._least, self._left / self._capacity)
        for emptied in np.flatnonzero((self._left == 0.0) & (before > 0.0)):
            self._empty.setdefault(self._numbers[emptied], record.k)

    def _end(self) -> str:
        self._warnings = [
            f"the battery of {self._name(number)} was empty at tick {k} ({k * self._step:g} s)"
            for number, k in sorted(self._empty.items(), key=lambda pair: (pair[1], pair[0]))
        ]
        lowest = int(self._least.argmin())
        name, percent = self._name(self._numbers[lowest]), 100.0 * self._least[lowest]
        return "; ".join(self._warnings) or f"none got empty; the least charge was {percent:.0f} %, of {name}"

    def _way_of(self, row: RobotTick) -> float:
        if row.bumped:
            return 0.0
        return self._run.command(row).speed_mps * self._step

    def _find_charging(self, rows: list[RobotTick], stands: NDArray[np.bool_]) -> set[int]:
        """Return the indices of the robots that docks charge: at each dock the nearest one that stands there."""
        if not len(self._places) or not stands.any():
            return set()
        spots = np.array([(row.x, row.y) for row in rows])
        away = np.hypot(spots[:, None, 0] - self._places[None, :, 0], spots[:, None, 1] - self._places[None, :, 1])
        # Rounded, so that the last bit does not decide which of two robots is charged.
        away = away.round(DIGITS)
        away[~stands] = np.inf
        nearest = away.argmin(axis=0)
        return {int(index) for dock, index in enumerate(nearest) if away[index, dock] <= self._reaches[dock]}
