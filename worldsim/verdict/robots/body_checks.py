"""The verdict's checks of bodies: where they are and how they got there."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from patrol.faults.kinds import Motion
from patrol.ground.swept_path import advance, free_fraction, path_is_free
from patrol.journal import RobotTick, Status, TickRecord
from patrol.pose import Command, Pose, command_of, is_halt
from worldsim.kernels.apart import first_overlap
from worldsim.robots.motion import length
from worldsim.robots.noise import MotionNoise
from worldsim.verdict.common.check import Check
from worldsim.verdict.common.closed_ground import ClosedGround
from worldsim.verdict.common.faults import active
from worldsim.verdict.common.robots_there import RobotsThere
from worldsim.verdict.robots.expected_statuses import ExpectedStatuses

if TYPE_CHECKING:
    from patrol.scenario import RobotSpec
    from worldsim.verdict.common.check import JudgedRun, Readings

SLACK = 1e-6
"""Depth (m) of a body in a wall or another body from which on a check calls it an overlap."""


class BodiesApart(Check):
    """No body that is there is over a wall or overlaps another in any tick, recomputed from the poses."""

    name = "bodies apart"
    needs = (RobotsThere, ExpectedStatuses, ClosedGround)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._expected = readings[ExpectedStatuses]
        self._names = run.names
        self._ground = readings[ClosedGround]
        self._radii = {robot.number: robot.radius for robot in run.journal.header.robots}
        self._looked = 0

    def _tick(self, record: TickRecord) -> None:
        here = [robot for robot in record.robots if robot.number not in self._expected.away]
        self._looked += len(here)
        places = np.array([(robot.x, robot.y) for robot in here], dtype=np.float64).reshape(-1, 2)
        radii = [self._radii[robot.number] for robot in here]
        i, j = first_overlap(places, np.array(radii, dtype=np.float64), SLACK)
        if i < len(here):
            pair = f"{self._names[here[i].number]} and {self._names[here[j].number]}"
            apart = math.dist(places[i], places[j])
            self._fail(f"{pair} overlap at tick {record.k}, centres {apart:.3f} m apart")
        terrain = self._ground.terrain
        for robot, radius in zip(here, radii, strict=True):
            pose = Pose(robot.x, robot.y, robot.heading)
            if free_fraction(terrain, pose, pose, max(radius - SLACK, 0.0)) < 1.0:
                where = f"({robot.x:.3f}, {robot.y:.3f})"
                self._fail(f"{self._names[robot.number]} is over a wall at tick {record.k}, at {where}")

    def _good(self) -> str:
        return f"{self._looked} poses clear of each other and of walls"


class MovesAreTrue(Check):
    """Each body goes from its start where its commands take it, to the bit, and they are within its limits.

    Under motion faults it goes where commands and draws take it; the check `motion` judges these draws. Without one it
    does exactly what it is commanded.

    A body without a driver, or whose move was cancelled, stays exactly where it is; one that was away comes back at
    its start. A move that was not cancelled touches no wall. For one that was cancelled there is a wall in its way, or
    another body so near that the two could have met; whether they would have met is not recomputed.
    """

    name = "moves"
    needs = (RobotsThere, ExpectedStatuses, ClosedGround)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        roster = run.prepared.scenario.roster
        self._expected = readings[ExpectedStatuses]
        self._step = run.step
        self._ground = readings[ClosedGround]
        self._specs = {spec.number: spec for spec in roster}
        self._noise = MotionNoise(run.prepared.scenario, run.timeline)
        self._uneven = [entry for entry in run.timeline.entries if isinstance(entry.fault, Motion)]
        self._starts = {spec.number: start for spec, start in zip(roster, run.prepared.starts, strict=True)}
        self._due = dict(self._starts)
        self._looked = 0

    def _tick(self, record: TickRecord) -> None:
        for number in self._expected.appeared:
            self._due[number] = self._starts[number]
        commands = {row.number: command_of(self._specs[row.number].model, row.c0, row.c1) for row in record.robots}
        uneven = {number for entry in self._uneven if active(entry, record.k) for number in entry.who}
        driven = commands | {n: to for n, to in self._noise.driven(record.k, commands).items() if n in uneven}
        for row in record.robots:
            spec, pose = self._specs[row.number], Pose(row.x, row.y, row.heading)
            problem = self._problem_of(row, spec, pose, commands[row.number])
            problem = problem or self._problem_of_cancelling(row, pose, driven, record.robots)
            if problem:
                self._fail(f"{spec.name} {problem} at tick {record.k}")
                return
            moves = not row.bumped and not is_halt(driven[row.number])
            self._due[row.number] = advance(pose, driven[row.number], self._step) if moves else pose
            self._looked += 1

    def _good(self) -> str:
        return f"{self._looked} poses follow from the commands"

    def _problem_of_cancelling(
        self, row: RobotTick, pose: Pose, driven: Mapping[int, Command], rows: Sequence[RobotTick]
    ) -> str:
        """Describe the error of a move that was cancelled without reason, or wrongly not cancelled."""
        radius, far = self._specs[row.number].radius, length(driven[row.number], self._step)
        if far <= 0.0:
            return "has a cancelled move although it does not drive" if row.bumped else ""
        free = path_is_free(self._ground.terrain, pose, driven[row.number], self._step, radius)
        if not row.bumped:
            return "" if free else "drives through a wall"
        if not free:
            return ""
        for other in rows:
            if other.number == row.number or other.number in self._expected.away:
                continue
            reach = radius + self._specs[other.number].radius + far + length(driven[other.number], self._step)
            if math.hypot(other.x - row.x, other.y - row.y) <= reach + SLACK:
                return ""
        return "has a cancelled move although neither a wall nor another body was in its way,"

    def _problem_of(self, row: RobotTick, spec: RobotSpec, pose: Pose, command: Command) -> str:
        due = self._due[row.number]
        if pose != due:
            return f"is at {_place(pose)} and not at {_place(due)}, where its last move ended,"
        if row.status is not Status.ALIVE and (not is_halt(command) or row.bumped):
            return f"is {row.status.name.lower()} and drives"
        if row.refused and (row.c0 != 0.0 or row.c1 != 0.0):
            return "drives although its command was refused"
        within = command.is_within(spec.limits)
        return "" if within else f"obeys {command}, which is beyond its limits,"


def _place(pose: Pose) -> str:
    return f"({pose.x!r}, {pose.y!r}; {pose.heading!r} rad)"
