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

__all__ = ["COMMANDS", "Command", "Drive", "Limits", "Model", "Pose", "Twist", "Velocity", "halted", "is_halt", "wrap"]

TAU = 2.0 * math.pi

ROUNDED = 1.0 + 1e-12
"""A command that was scaled to a top speed may exceed it by this factor."""


def wrap(angle: float) -> float:
    """Return the same angle in (-pi, pi], rad; for example -2.283 for 4.0."""
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
class Limits:
    """The bounds of a body's commands; each model uses those that apply to it.

    Attributes:
        speed: Top speed, m/s.
        radius: Radius of the round body, m. The wheels of a differential drive are this far left and right of its
            centre.
        turning_radius: Radius of a car's tightest turn, m.
    """

    speed: float
    radius: float
    turning_radius: float


@dataclass(frozen=True, slots=True)
class Velocity:
    """A holonomic robot's command for one step.

    For example, ``Velocity(0.6, 0.8)`` moves at 1 m/s.

    Attributes:
        vx: Velocity along the map's x axis, m/s.
        vy: Velocity along the map's y axis, m/s.
        facing: The heading after the step, rad; None for that in which the body moves.
    """

    vx: float
    vy: float
    facing: float | None = None

    @property
    def numbers(self) -> tuple[float, float]:
        """The two numbers that stand for the command in a journal, a trace and a message."""
        return self.vx, self.vy

    @property
    def speed_mps(self) -> float:
        """The body's speed, m/s."""
        return math.hypot(self.vx, self.vy)

    def is_within(self, limits: Limits) -> bool:
        """Return True if a body obeys the command unchanged; a scaled command may exceed the speed by rounding.

        Args:
            limits: Of the body; only the speed applies.
        """
        return self.speed_mps <= limits.speed * ROUNDED

    def limited(self, limits: Limits) -> Velocity:
        """Return the nearest command that the body can obey.

        Args:
            limits: Of the body; only the speed applies.

        Returns:
            The same direction, at most at top speed.
        """
        fastest = max(abs(self.vx), abs(self.vy))
        if fastest == 0.0:
            return Velocity(0.0, 0.0, self.facing)
        # Scaled by the larger component first, so that no finite velocity overflows.
        share = math.hypot(self.vx / fastest, self.vy / fastest)
        cut = min(fastest, limits.speed / share)
        return self if cut == fastest else Velocity(self.vx / fastest * cut, self.vy / fastest * cut, self.facing)


@dataclass(frozen=True, slots=True)
class Drive:
    """A car's command for one step.

    For example, ``Drive(-1.0, 0.5)`` reverses at 1 m/s along a circle of 2 m.

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
        """The body's speed along its path, m/s."""
        return abs(self.speed)

    def is_within(self, limits: Limits) -> bool:
        """Return True if a body obeys the command unchanged.

        Args:
            limits: Of the body: its top speed, forward and in reverse, and its turning radius.
        """
        return abs(self.speed) <= limits.speed and abs(self.curvature) <= 1.0 / limits.turning_radius

    def limited(self, limits: Limits) -> Drive:
        """Return the nearest command that the body can obey.

        Args:
            limits: Of the body: its top speed, forward and in reverse, and its turning radius.

        Returns:
            Speed and curvature, each cut to its limit.
        """
        top, tightest = limits.speed, 1.0 / limits.turning_radius
        return Drive(min(max(self.speed, -top), top), min(max(self.curvature, -tightest), tightest))


@dataclass(frozen=True, slots=True)
class Twist:
    """A differential drive's command for one step. With no speed the body turns on the spot.

    For example, ``Twist(0.5, 0.2)`` drives at 0.5 m/s while it turns left at 0.2 rad/s.

    Two wheels, one body radius left and right of the centre, run at ``speed`` -/+ ``turn_rate * radius``, each at most
    at top speed. So ``abs(speed) + abs(turn_rate) * radius`` is at most the top speed.

    Attributes:
        speed: Of the centre, m/s; negative for reverse.
        turn_rate: rad/s; positive to the left.
    """

    speed: float
    turn_rate: float

    @property
    def numbers(self) -> tuple[float, float]:
        """The two numbers that stand for the command in a journal, a trace and a message."""
        return self.speed, self.turn_rate

    @property
    def speed_mps(self) -> float:
        """The speed of the body's centre along its path, m/s."""
        return abs(self.speed)

    def is_within(self, limits: Limits) -> bool:
        """Return True if a body obeys the command unchanged; a scaled command may exceed the speed by rounding.

        Args:
            limits: Of the body: the top speed of each wheel, and the radius.
        """
        return abs(self.speed) + abs(self.turn_rate) * limits.radius <= limits.speed * ROUNDED

    def limited(self, limits: Limits) -> Twist:
        """Return the nearest command that the body can obey.

        Args:
            limits: Of the body: the top speed of each wheel, and the radius.

        Returns:
            The same arc, driven with the faster wheel at most at top speed.
        """
        if abs(self.speed) + abs(self.turn_rate) * limits.radius <= limits.speed:
            return self
        # Scaled by the larger number first, so that no finite command overflows.
        larger = max(abs(self.speed), abs(self.turn_rate))
        speed, turn_rate = self.speed / larger, self.turn_rate / larger
        cut = limits.speed / (abs(speed) + abs(turn_rate) * limits.radius)
        return Twist(speed * cut, turn_rate * cut)


Command = Velocity | Drive | Twist
Model = Literal["car", "differential", "holonomic"]
MODELS: tuple[str, ...] = get_args(Model)

COMMANDS: Mapping[str, type[Command]] = {"car": Drive, "differential": Twist, "holonomic": Velocity}
"""The type of command that each model obeys."""

TURNS_IN_ARCS = frozenset({"car"})
"""The models that have a turning radius."""

_ON_THE_WIRE: tuple[type[Command], ...] = (Velocity, Drive, Twist)
"""A command's type in a message is its index in this list, so new types go to the end."""


def command_of(model: str, first: float, second: float, facing: float | None = None) -> Command:
    """Make the command of a model from its two `numbers`, and where a holonomic robot faces, rad."""
    return Velocity(first, second, facing) if model == "holonomic" else COMMANDS[model](first, second)


def is_halt(command: Command) -> bool:
    """Return True if a body that obeys this command neither drives nor turns."""
    turns = command.turn_rate != 0.0 if isinstance(command, Twist) else facing_of(command) is not None
    return command.speed_mps == 0.0 and not turns


def facing_of(command: Command) -> float | None:
    """Return where a body is to face after the step, rad; None where its path decides."""
    return command.facing if isinstance(command, Velocity) else None


def scaled(command: Command, share: float) -> Command:
    """Return the command for the same path at a share of its speed."""
    if isinstance(command, Drive):
        return Drive(command.speed * share, command.curvature)
    if isinstance(command, Velocity):
        return Velocity(command.vx * share, command.vy * share, command.facing)
    return Twist(command.speed * share, command.turn_rate * share)


def slowed(command: Command, top_mps: float) -> Command:
    """Return a command that leads along the same path, but at most at a given speed of the body's centre.

    Args:
        command: Finite.
        top_mps: m/s.
    """
    return command if command.speed_mps <= top_mps else scaled(command, top_mps / command.speed_mps)


def halted(model: str) -> Command:
    """Return the command that stops a body of this model."""
    return command_of(model, 0.0, 0.0)


def pack_command(command: Command) -> tuple[int, float, float, float | None]:
    """Pack a command as its type, its two `numbers` and where it faces, for a message."""
    first, second = command.numbers
    facing = facing_of(command)
    return _ON_THE_WIRE.index(type(command)), float(first), float(second), None if facing is None else float(facing)


def unpack_command(kind: int, first: float, second: float, facing: float | None = None) -> Command:
    """Unpack a command from `pack_command`; its numbers may be infinite or NaN, which the receiver refuses.

    Args:
        kind: Index of the command's type.
        first: First of its `numbers`.
        second: Second of its `numbers`.
        facing: Where a holonomic robot faces after the step, rad; no other one has it.

    Raises:
        ValueError: There is no such type, or it is not that of a holonomic robot and has a heading.
    """
    if not 0 <= kind < len(_ON_THE_WIRE):
        raise ValueError(f"no kind of command has the number {kind}")
    command_type = _ON_THE_WIRE[kind]
    if facing is not None and command_type is not Velocity:
        raise ValueError(f"a {command_type.__name__} does not say where the body faces")
    return Velocity(first, second, facing) if command_type is Velocity else command_type(first, second)
