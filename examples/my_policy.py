"""A policy of one's own: go to what is stale for its distance, see it, choose the next.

    fogwatch run yards --set patrol.policy=./examples/my_policy.py:GreedyTarget --set patrol.options.near=10

docs/policies.md says what a policy gets to know and what it may answer.
"""

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from fogwatch import Intent, Place, PolicySetup, Stay, View


class GreedyTarget:
    """Takes the point with the greatest age per metre of way, and keeps it until a robot has seen it."""

    class Options(BaseModel):
        """The fields of `patrol.options`."""

        model_config = ConfigDict(extra="forbid")
        near: float = Field(4.0, gt=0, description="m, added to each way; the larger, the less the distance matters")
        patience: float = Field(120.0, gt=0, description="s on the way to one target before another is chosen")

    def __init__(self, setup: PolicySetup) -> None:
        self._near = setup.options.near
        self._patience = setup.options.patience / setup.fleet.step
        self._target: tuple[int, int] | None = None
        self._chosen_at = 0

    def decide(self, view: View) -> Intent:
        """Go to the target, or to a new one when that has been seen or takes too long."""
        target = self._target
        if (
            target is None
            or view.fog.last_seen[target] >= self._chosen_at
            or view.tick - self._chosen_at > self._patience
        ):
            self._target, self._chosen_at = self._best(view), view.tick
        if self._target is None:
            return Stay()
        return Place(*view.stand_to_see(self._target))

    def _best(self, view: View) -> tuple[int, int] | None:
        """Return the point with the greatest age per metre; None for a robot that cannot get anywhere."""
        score = view.age / (view.lengths_to_see() + self._near)
        row, col = np.unravel_index(int(np.argmax(score)), score.shape)
        return (int(row), int(col)) if score[row, col] > 0.0 else None
