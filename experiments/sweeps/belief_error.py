"""How far what robots believe of the fog is from the truth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from agent.mind import Mind
    from worldsim.world import World

EVERY = 50
"""Ticks from one look to the next."""


class BeliefError:
    """Compares the living robots' believed fog with the true one, now and then.

    A robot that misses a position believes points staler than they are; one that believes a forged position takes
    points for fresher. Both are counted over the points that the robot itself could see.
    """

    def __init__(self) -> None:
        self._looks = 0
        self._error_s = 0.0
        self._fresher = 0.0

    def look(self, world: World, minds: Mapping[int, Mind]) -> None:
        """A tick is over; see `experiments.inprocess.run_in_process`."""
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
        """Means over looks, robots and points.

        belief_error_s: of the difference between the believed and the true age, whatever its sign. believed_fresher:
        share of the points that are taken for fresher than they are. None for a run too short to look at.
        """
        if self._looks == 0:
            return {"belief_error_s": None, "believed_fresher": None}
        return {"belief_error_s": self._error_s / self._looks, "believed_fresher": self._fresher / self._looks}
