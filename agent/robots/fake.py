"""A fake robot: a body that moves as it is told, on a map, without a simulator. For tests and as a pattern."""

from __future__ import annotations

from agent.ports import FleetClock
from patrol.exchange import Sensed
from patrol.ground.swept_path import advance, path_is_free
from patrol.ground.terrain import Terrain
from patrol.pose import Command, Pose, halted
from patrol.scenario import RobotSpec


class FakeRobot:
    """A robot (`agent.ports.Robot`) that obeys at once, and stays where it is when a wall is in the way."""

    def __init__(self, clock: FleetClock, spec: RobotSpec, terrain: Terrain, start: Pose, step: float) -> None:
        """Put the body on its start; `step` is in s of robot time per tick."""
        self.pose = start
        self.stopped = ""
        self._clock = clock
        self._spec = spec
        self._terrain = terrain
        self._step = step
        self._command: Command = halted(spec.model)
        self._k = -1

    def sense(self) -> Sensed | None:
        """Wait for the next tick; return where the last command has led, and whether a wall was in its way."""
        k = self._clock.tick()
        if k is None:
            return None
        bumped = False
        # A command holds for one step: a body that has not been told anything since stands still.
        if k == self._k + 1:
            free = path_is_free(self._terrain, self.pose, self._command, self._step, self._spec.radius)
            bumped = not free
            if free:
                self.pose = advance(self.pose, self._command, self._step)
        self._k = k
        self._command = halted(self._spec.model)
        return Sensed(k, self.pose, bumped, clock_s=k * self._step)

    def act(self, command: Command) -> None:
        """Obey until the next tick, within the body's limits."""
        self._command = command.limited(self._spec.limits)

    def stop(self, reason: str) -> None:
        """Stand still for good."""
        self.stopped = reason
        self._command = halted(self._spec.model)
