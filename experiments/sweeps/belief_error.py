"""The error of the robots' belief: how far the fog that they believe in is from the true fog."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from agent.mind import Mind
    from worldsim.world import World

EVERY = 50
"""Ticks between two comparisons."""


class BeliefError:
    """Compares the fog that living robots believe in with the true fog, every `EVERY` ticks.

    A robot that misses a position believes that points are staler than they are; a robot that believes a forged
    position believes that points are fresher. Both are measured over the points that the robot itself could see.
    """

    def __init__(self) -> None:
        self._looks = 0
        self._error_s = 0.0
        self._fresher = 0.0

    def look(self, world: World, minds: Mapping[int, Mind]) -> None:
        """Compare, if it is time to; called after each tick by `fogwatch.inprocess.run_in_process`."""
        if world.tick % EVERY:
            return
        true = np.maximum(world.truth.fog.last_seen, 0)
        for number in world.living:
            fog = minds[number].belief.fog
            own = fog.patrolled.view(np.bool_)
            later = np.maximum(fog.last_seen[own], 0) - true[own]
            self._looks += 1
            self._error_s += float(np.mean(np.abs(later))) * world.step
            self._fresher += float(np.count_nonzero(later > 0)) / fog.points

    def metrics(self) -> dict[str, float | None]:
        """Return the error so far, as means over comparisons, robots and points.

        ``belief_error_s`` is the absolute difference between the believed and the true age of a point in s,
        ``believed_fresher`` the share of the points that are believed fresher than they are. Both are None for a run
        too short to compare.
        """
        if self._looks == 0:
            return {"belief_error_s": None, "believed_fresher": None}
        return {"belief_error_s": self._error_s / self._looks, "believed_fresher": self._fresher / self._looks}
