"""Random steps, which keep a patrol unpredictable (paper, step 6)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from patrol.pose import TAU
from patrol.random import Purpose

if TYPE_CHECKING:
    from agent.view import View


class RandomSteps:
    """Draws the random steps of one robot, with the same probability in each tick."""

    def __init__(self, probability: float) -> None:
        self._probability = probability

    def draw(self, view: View) -> float | None:
        """Return the direction of a random step, rad, or None in most ticks."""
        if self._probability > 0.0 and view.draw(0, Purpose.RANDOM_MOVE) < self._probability:
            return TAU * view.draw(1, Purpose.RANDOM_MOVE)
        return None
