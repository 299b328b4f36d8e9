"""Batteries: the charge of each robot, from its moves tick by tick.

A robot uses `idle` watts all the time and `drive` joules for each metre. It charges while it stands within the radius
of a dock; a dock charges one robot at a time, the one nearest to its place. Metres are those of the command, which
wheels drive also while they slip. For example, a battery of 30 Wh (108 kJ) with 10 W at rest and 35 J per m at 1 m/s is
empty after 108,000 / (10 + 35) = 2400 s of driving, 40 minutes.

The world keeps the charge by this, and summaries and pages read it again from a journal's rows. The verdict has an
arithmetic of its own (`worldsim.checks.bodies`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from patrol.journal.records import RobotTick, Status
from patrol.pose import command_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from patrol.energy.checks import ChargedRobot
    from patrol.energy.spec import DockSpec

EMPTY_J = 1e-3
"""A battery with less than this in it is empty, J."""

DIGITS = 6
"""Decimals of a distance to a dock, m: which of two robots is nearer must not depend on the last bit."""

GONE = frozenset({Status.ABSENT, Status.DEAD, Status.LOST, Status.LEFT})
"""Statuses in which a robot neither uses nor charges.

A robot that was in one of them for a tick comes back with the charge of the start. One whose process is restarted
between two ticks keeps its charge.
"""


class Batteries:
    """The charge of all robots that have a battery.

    `docked` are the numbers of the robots that charged in the last tick.
    """

    def __init__(self, roster: Sequence[ChargedRobot], docks: Sequence[DockSpec], step: float) -> None:
        """Begin with each battery's first charge."""
        self._step, self._docks = step, docks
        self._models = {spec.number: spec.model for spec in roster}
        self._specs = {spec.number: spec.battery for spec in roster if spec.battery is not None}
        self._levels_j = {number: spec.start * spec.capacity_j for number, spec in self._specs.items()}
        self._before: dict[int, Status] = {}
        self.docked: frozenset[int] = frozenset()

    @property
    def shares(self) -> dict[int, float]:
        """The share of its capacity that is left in each battery, by the robot's number."""
        return {number: level_j / self._specs[number].capacity_j for number, level_j in self._levels_j.items()}

    @property
    def numbers(self) -> list[int]:
        """Numbers of the robots that have a battery, ascending."""
        return list(self._specs)

    def share(self, number: int) -> float | None:
        """Return the share of a battery's capacity that is left; None for a robot without a battery."""
        spec = self._specs.get(number)
        return None if spec is None else self._levels_j[number] / spec.capacity_j

    def is_empty(self, number: int) -> bool:
        """Return True if a robot has a battery, and nothing in it."""
        return self._levels_j.get(number, math.inf) == 0.0

    def renew(self, number: int) -> None:
        """Put a battery as at the start into a robot that comes back; nothing for one that was not away for a tick."""
        if number in self._specs and self._before.get(number) in GONE:
            self._levels_j[number] = self._specs[number].start * self._specs[number].capacity_j

    def resume(self, shares: Mapping[int, float], rows: Iterable[RobotTick]) -> None:
        """Go on from the shares that were left after a tick, whose rows are given."""
        self._levels_j = {number: shares[number] * spec.capacity_j for number, spec in self._specs.items()}
        self._before = {row.number: row.status for row in rows}

    def tick(self, rows: Iterable[RobotTick]) -> None:
        """Take in the robots' moves of a tick."""
        if not self._specs:
            return
        powered: dict[int, tuple[RobotTick, float]] = {}
        for row in rows:
            if row.number not in self._specs:
                continue
            if row.status not in GONE:
                self.renew(row.number)
                command = command_of(self._models[row.number], row.c0, row.c1)
                powered[row.number] = row, 0.0 if row.bumped else command.speed_mps * self._step
            self._before[row.number] = row.status
        self.docked = self._at_docks(row for row, way_m in powered.values() if way_m == 0.0)
        for number, (_, way_m) in powered.items():
            spec = self._specs[number]
            level_j = self._levels_j[number] - spec.idle * self._step - spec.drive * way_m
            if number in self.docked:
                level_j += spec.charge * self._step
            self._levels_j[number] = 0.0 if level_j < EMPTY_J else min(level_j, spec.capacity_j)

    def _at_docks(self, standing: Iterable[RobotTick]) -> frozenset[int]:
        """Return the robots that docks charge."""
        rows = list(standing)
        docked = set()
        for dock in self._docks:
            near = [(round(math.dist(dock.place, (row.x, row.y)), DIGITS), row.number) for row in rows]
            away, number = min(near, default=(math.inf, 0))
            if away <= dock.radius:
                docked.add(number)
        return frozenset(docked)
