"""The next velocity of the robot, many times a tick: zero in any case of doubt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from agent.robots.ros2.driving.commands import nearer
from agent.robots.ros2.driving.fence import Fence
from agent.robots.ros2.driving.others import Other
from patrol.pose import Command, Limits, Pose, halted, is_halt

OFF_GROUND = (
    "it is off the map's ground: in a wall, in a keep-out area or beyond the map; move it, or correct its localisation"
)
TOO_NEAR = "a wall or a robot is too near"


@dataclass(frozen=True, slots=True)
class Rule:
    """The limits of one body.

    Attributes:
        model: Of the body.
        limits: Its top speed (m/s), radius (m) and turning radius (m).
        acceleration: The most by which a speed may change, m/s².
        hold_s: For how long a command is obeyed, s.
    """

    model: str
    limits: Limits
    acceleration: float
    hold_s: float


class Governor:
    """Obeys a mind's commands within limits, and only as long as it is safe.

    Attributes:
        command: What the robot was told last.
        why: Why it was not told what the mind wants: empty if it was.
        fenced: Whether that was because of the fence.

    Args:
        rule: The body's limits.
        fence: Where it may go.
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
        """A new command of the mind.

        Args:
            command: Of the body's model.
            now_s: The time, s.
        """
        self._wanted = command.limited(self._rule.limits)
        self._until_s = now_s + self._rule.hold_s

    def step(
        self, pose: Pose | None, now_s: float, since_s: float, stopped: str, others: Sequence[Other] = ()
    ) -> Command:
        """Return the velocity to send now.

        Args:
            pose: Its pose; None if unknown.
            now_s: The time, s.
            since_s: Time since the last step, s.
            stopped: Why it has to stand whatever the mind wants; empty if it has not.
            others: The other robots.
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
