"""Where a robot is and what it is told to do.

Everything is in metres, seconds and radians; headings run counter-clockwise from the +x axis and lie in (-pi, pi].
"""

from __future__ import annotations

import math
from dataclasses import dataclass

TAU = 2.0 * math.pi


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


@dataclass(frozen=True, slots=True)
class Drive:
    """A car's command for one step: speed in m/s (negative: reverse) and curvature in 1/m (positive: left)."""

    speed: float
    curvature: float


Command = Velocity | Drive
