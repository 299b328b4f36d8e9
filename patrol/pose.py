"""A robot's pose, and the command that it obeys.

Everything is in metres, seconds and radians; headings run counter-clockwise from the +x axis and lie in (-pi, pi].

A body's model decides which type of command it obeys. To add a model, add its command with its limits here, and its
motion to `patrol.ground.swept_path`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

TAU = 2.0 * math.pi

ROUNDED = 1.0 + 1e-12
"""A velocity that was scaled to a top speed may exceed it by this factor."""


def wrap(angle: float) -> float:
    """The same angle in (-pi, pi], rad."""
    turned = math.remainder(angle, TAU)
    return math.pi if turned == -math.pi else turned


@dataclass(frozen=True, slots=True)
class Pose:
    """A robot's position and heading in the map's frame.

    Attributes:
        x: m.
        y: m.
        heading: rad.
    """

    x: float
    y: float
    heading: float


@dataclass(frozen=True, slots=True)
class Velocity:
    """A holonomic robot's command for one step.

    Attributes:
        vx: Velocity along the map's x axis, m/s.
        vy: Velocity along the map's y axis, m/s.
    """

    vx: float
    vy: float

    @property
    def numbers(self) -> tuple[float, float]:
        """The two numbers that stand for the command in a journal, a trace and a message."""
        return self.vx, self.vy

    @property
    def speed_mps(self) -> float:
        """How fast the body drives, m/s."""
        return math.hypot(self.vx, self.vy)

    def is_within(self, speed: float, turning_radius: float) -> bool:
        """Whether a body obeys the command unchanged; a scaled command may exceed the speed by rounding.

        Args:
            speed: Top speed, m/s.
            turning_radius: Not used: a holonomic robot turns on the spot.
        """
        del turning_radius
        return self.speed_mps <= speed * ROUNDED

    def limited(self, speed: float, turning_radius: float) -> Velocity:
        """The nearest command that the body can obey.

        Args:
            speed: Top speed, m/s.
            turning_radius: Not used: a holonomic robot turns on the spot.

        Returns:
            The same direction, at most at top speed.
        """
        del turning_radius
        fastest = max(abs(self.vx), abs(self.vy))
        if fastest == 0.0:
            return Velocity(0.0, 0.0)
        # Scaled by the larger component first, so that no finite velocity overflows.
        share = math.hypot(self.vx / fastest, self.vy / fastest)
        cut = min(fastest, speed / share)
        return self if cut == fastest else Velocity(self.vx / fastest * cut, self.vy / fastest * cut)


@dataclass(frozen=True, slots=True)
class Drive:
    """A car's command for one step.

    Attributes:
        speed: m/s; negative for reverse.
        curvature: 1/m; positive to the left.
    """

    speed: float
    curvature: float

    @property
    def numbers(self) -> tuple[float, float]:
        """The two numbers that stand for the command in a journal, a trace and a message."""
        return self.speed, self.curvature

    @property
    def speed_mps(self) -> float:
        """How fast the body drives along its path, m/s."""
        return abs(self.speed)

    def is_within(self, speed: float, turning_radius: float) -> bool:
        """Whether a body obeys the command unchanged.

        Args:
            speed: Top speed, m/s, forward and in reverse.
            turning_radius: Of the tightest turn, m.
        """
        return abs(self.speed) <= speed and abs(self.curvature) <= 1.0 / turning_radius

    def limited(self, speed: float, turning_radius: float) -> Drive:
        """The nearest command that the body can obey.

        Args:
            speed: Top speed, m/s, forward and in reverse.
            turning_radius: Of the tightest turn, m.

        Returns:
            Speed and curvature, each cut to its limit.
        """
        tightest = 1.0 / turning_radius
        return Drive(min(max(self.speed, -speed), speed), min(max(self.curvature, -tightest), tightest))


Command = Velocity | Drive
Model = Literal["car", "holonomic"]
MODELS: tuple[str, ...] = get_args(Model)

COMMANDS: Mapping[str, type[Velocity] | type[Drive]] = {"car": Drive, "holonomic": Velocity}
"""The type of command that each model obeys."""

TURNS_IN_ARCS = frozenset({"car"})
"""The models that have a turning radius."""

_ON_THE_WIRE: tuple[type[Velocity] | type[Drive], ...] = (Velocity, Drive)
"""A command's type in a message is its index in this list, so new types go to the end."""


def command_of(model: str, first: float, second: float) -> Command:
    """The command of a model from its two `numbers`."""
    return COMMANDS[model](first, second)


def halted(model: str) -> Command:
    """The command that stops a body of this model."""
    return command_of(model, 0.0, 0.0)


def pack_command(command: Command) -> tuple[int, float, float]:
    """A command as its type and its two `numbers`, for a message."""
    first, second = command.numbers
    return _ON_THE_WIRE.index(type(command)), float(first), float(second)


def unpack_command(kind: int, first: float, second: float) -> Command:
    """The command that `pack_command` packed; its numbers may be infinite or NaN, which the receiver refuses.

    Args:
        kind: Index of the command's type.
        first: First of its `numbers`.
        second: Second of its `numbers`.

    Raises:
        ValueError: There is no such type.
    """
    if not 0 <= kind < len(_ON_THE_WIRE):
        raise ValueError(f"no kind of command has the number {kind}")
    return _ON_THE_WIRE[kind](first, second)
