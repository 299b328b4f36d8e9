"""Where a robot is and what it is told to do.

Everything is in metres, seconds and radians; headings run counter-clockwise from the +x axis and lie in (-pi, pi].

A body's model decides which kind of command it obeys. Whoever adds a model adds its command here, with its limits, and
where it takes a body in `patrol.ground.swept_path`.
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
    """The same angle in (-pi, pi], in radians."""
    turned = math.remainder(angle, TAU)
    return math.pi if turned == -math.pi else turned


@dataclass(frozen=True, slots=True)
class Pose:
    """A robot's position (m) and heading (rad) in the map's frame."""

    x: float
    y: float
    heading: float


@dataclass(frozen=True, slots=True)
class Velocity:
    """A holonomic robot's command for one step: velocity along x and y in m/s, in the map's frame."""

    vx: float
    vy: float

    @property
    def numbers(self) -> tuple[float, float]:
        """The two numbers that a journal, a trace and a message hold."""
        return self.vx, self.vy

    @property
    def speed_mps(self) -> float:
        """How fast the body drives, m/s."""
        return math.hypot(self.vx, self.vy)

    def is_within(self, speed: float, turning_radius: float) -> bool:
        """Whether a body with these limits (m/s, m) obeys the command as it is; scaled ones may be rounded up."""
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
    """A car's command for one step: speed in m/s (negative: reverse) and curvature in 1/m (positive: left)."""

    speed: float
    curvature: float

    @property
    def numbers(self) -> tuple[float, float]:
        """The two numbers that a journal, a trace and a message hold."""
        return self.speed, self.curvature

    @property
    def speed_mps(self) -> float:
        """How fast the body drives along its path, m/s."""
        return abs(self.speed)

    def is_within(self, speed: float, turning_radius: float) -> bool:
        """Whether a body with these limits (m/s, m) obeys the command as it is."""
        return abs(self.speed) <= speed and abs(self.curvature) <= 1.0 / turning_radius

    def limited(self, speed: float, turning_radius: float) -> Drive:
        """The nearest command that the body can obey.

        Args:
            speed: Top speed, m/s, forward and in reverse.
            turning_radius: Of the tightest turn, m.

        Returns:
            Speed and curvature cut to the limits, each by itself.
        """
        tightest = 1.0 / turning_radius
        return Drive(min(max(self.speed, -speed), speed), min(max(self.curvature, -tightest), tightest))


Command = Velocity | Drive
Model = Literal["car", "holonomic"]
MODELS: tuple[str, ...] = get_args(Model)

COMMANDS: Mapping[str, type[Velocity] | type[Drive]] = {"car": Drive, "holonomic": Velocity}
"""The kind of command that each model obeys."""

TURNS_IN_ARCS = frozenset({"car"})
"""The models to which a turning radius means something."""

_ON_THE_WIRE: tuple[type[Velocity] | type[Drive], ...] = (Velocity, Drive)
"""A command's kind in a message is its place in this list, so new kinds go to the end."""


def command_of(model: str, first: float, second: float) -> Command:
    """The command of a model from its two `numbers`."""
    return COMMANDS[model](first, second)


def halted(model: str) -> Command:
    """The command that stops a body of this model."""
    return command_of(model, 0.0, 0.0)


def pack_command(command: Command) -> tuple[int, float, float]:
    """A command as its kind and its two `numbers`, for a message."""
    first, second = command.numbers
    return _ON_THE_WIRE.index(type(command)), float(first), float(second)


def unpack_command(kind: int, first: float, second: float) -> Command:
    """The command that `pack_command` packed.

    Raises:
        ValueError: There is no such kind. Numbers that are not finite pass: whoever obeys refuses them.
    """
    if not 0 <= kind < len(_ON_THE_WIRE):
        raise ValueError(f"no kind of command has the number {kind}")
    return _ON_THE_WIRE[kind](first, second)
