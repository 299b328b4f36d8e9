"""The next velocity of the robot, many times a tick: zero in any case of doubt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from patrol.pose import Command, Limits, Pose, halted, is_halt
from ros2.robot.commands import nearer
from ros2.robot.fence import Fence
from ros2.robot.others import Other

OFF_GROUND = (
    "it is off the map's ground: in a wall, in a keep-out area or beyond the map; move it, or correct its localisation"
)
TOO_NEAR = "a wall or a robot is too near"


@dataclass(frozen=True, slots=True)
class Rule:
    """The limits of one body."""

    model: str
    limits: Limits
    acceleration: float  # the most by which a speed may change, m/s²
    hold_s: float  # for which a command is obeyed


class Governor:
    """Obeys a mind's commands within limits, and only as long as it is safe.

    `command` is what the robot was told last. `why` is the reason why that was not what the mind wants, empty if it
    was; `fenced` is True if the fence slowed the robot down.
    """

    def __init__(self, rule: Rule, fence: Fence) -> None:
        self._rule = rule
        self._fence = fence
        self._halt = halted(rule.model)
        self._wanted = self._halt
        self._until_s = 0.0
        self.command: Command = self._halt
        self.why = ""
        self.fenced = False

    def want(self, command: Command, now_s: float) -> None:
        """Take in a new command of the mind, which is obeyed for `Rule.hold_s`."""
        self._wanted = command.limited(self._rule.limits)
        self._until_s = now_s + self._rule.hold_s

    def step(
        self, pose: Pose | None, now_s: float, since_s: float, stopped: str, others: Sequence[Other] = ()
    ) -> Command:
        """Return the velocity to send now.

        The robot stands while its pose is None, which means unknown, or while `stopped` gives a reason.
        """
        self.why = stopped or ("nobody knows where it is" if pose is None else "")
        self.fenced = False
        if self.why or pose is None:
            self.command = self._halt
            return self.command
        wanted = self._wanted if now_s < self._until_s else self._halt
        rule = self._rule
        eased = nearer(self.command, wanted, rule.acceleration * since_s, rule.limits.radius)
        self.command = self._fence.allowed(pose, eased.limited(rule.limits), others)
        self.fenced = self.command.speed_mps < eased.speed_mps
        if not self._fence.on_ground(pose):
            self.why = OFF_GROUND
        elif self.fenced:
            self.why = TOO_NEAR
        elif is_halt(wanted) and now_s >= self._until_s:
            self.why = "no command has come"
        return self.command
