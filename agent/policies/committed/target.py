"""What a robot has committed itself to."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Target:
    """What a robot has committed itself to.

    Attributes:
        point: The terrain's point (row, col) that is to be seen.
        stand: The point to go to. For a car this is the nearest one in sight of the target.
        close: The point to go to where the first did not do: the point itself, or its post.
        age: Of the point when it was chosen, ticks.
        away: Whether it was chosen so that the robot leaves a circle in which it has stayed for too long.
    """

    point: tuple[int, int]
    stand: tuple[int, int]
    close: tuple[int, int]
    age: int
    away: bool
