"""A policy of one's own: go to the stalest place near, see it, choose the next ("conscientious reactive").

    fogwatch run yards --set patrol.policy=./examples/my_policy.py:StalestNear --set patrol.options.reach=30

docs/policies.md says what a policy gets to know and what it may answer.
"""

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from agent.ports import Intent, Place, PolicySetup, Stay
from agent.view import View


class StalestNear:
    """Keeps its target until somebody has seen it."""

    class Options(BaseModel):
        """What `patrol.options` may say."""

        model_config = ConfigDict(extra="forbid")
        reach: float = Field(25.0, gt=0, description="m, how long the way to a target may be")

    def __init__(self, setup: PolicySetup) -> None:
        self._reach = setup.options.reach
        self._target: tuple[int, int] | None = None
        self._chosen_at = 0

    def decide(self, view: View) -> Intent:
        """The way to the target, or to a new one when that has been seen."""
        if self._target is None or view.fog.last_seen[self._target] >= self._chosen_at:
            self._target, self._chosen_at = self._stalest(view), view.tick
        if self._target is None:
            return Stay()
        return Place(*view.place_of(self._target))

    def _stalest(self, view: View) -> tuple[int, int] | None:
        """The stalest point within reach, the nearest of several; None for a robot that cannot get anywhere."""
        lengths = view.lengths(within=self._reach)
        near = np.isfinite(lengths)
        if not near.any():
            return None
        score = np.where(near, view.age - np.where(near, lengths, 0.0) / (2.0 * self._reach), -np.inf)
        row, col = np.unravel_index(int(np.argmax(score)), score.shape)
        return int(row), int(col)
