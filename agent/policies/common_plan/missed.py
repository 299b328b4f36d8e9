"""Points that a robot has missed of its part of the plan: its planned robot saw them from where it has not been."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from agent.policies.pursuit import Target

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from agent.policies.common_plan.plan import CommonPlan
    from agent.policies.pursuit import GivenUp
    from agent.ports import PolicySetup
    from agent.view import View

OVERDUE = 2.0
"""A missed point is gone to after so many times the time between two robots on the tour: most are seen before, when the
plan leads there again. Where something stands in the way, the plan leads past it in vain."""


class Missed:
    """The points that one robot has missed of one plan."""

    def __init__(self, setup: PolicySetup, plan: CommonPlan, number: int) -> None:
        """Begin with none."""
        fields, self._width = setup.ground.fields, setup.ground.terrain.width
        self._plan, self._number = plan, number
        self._due: dict[int, int] = {}  # the ticks of the plan at which points, flat indices, should have been seen
        own = np.arange(fields.reach.size)
        self._stands = np.where(fields.reach.reshape(-1), own, fields.proxy.reshape(-1))
        self._wait = round(OVERDUE * plan.interval_s / plan.step)
        self._chosen: int | None = None

    def skip(self, first: int, until: int, view: View) -> None:
        """Note what is seen in the plan at some ticks in a row that the robot has left out."""
        last_seen = view.fog.last_seen.reshape(-1)
        for tick in range(max(first, self._plan.since), until):
            seen = self._plan.seen_by(self._number, tick)
            for point in seen[last_seen[seen] < tick].tolist():
                self._due.setdefault(point, tick)

    def find(self, view: View, given_up: GivenUp) -> Target | None:
        """Return the point to go to now, the same until it has been seen; None where nothing is overdue."""
        if not self._due:
            return None
        points, due = (np.array(list(column), dtype=np.int64) for column in (self._due.keys(), self._due.values()))
        seen, patrolled = view.fog.last_seen.reshape(-1)[points], view.fog.patrolled.reshape(-1)[points]
        stands = self._stands[points]
        is_left = (seen < due) & patrolled & (stands >= 0)
        if given_up.now(view.tick).size:
            is_left &= ~given_up.covers(view.tick, stands, self._width)
        self._due = dict(zip(points[is_left].tolist(), due[is_left].tolist(), strict=True))
        if self._chosen not in self._due:
            self._chosen = self._choose(view, points, is_left & (view.tick - due > self._wait))
        if self._chosen is None:
            return None
        stand, age = int(self._stands[self._chosen]), view.tick - max(int(view.fog.last_seen.flat[self._chosen]), 0)
        return Target(divmod(self._chosen, self._width), divmod(stand, self._width), max(age, 1))

    def _choose(self, view: View, points: NDArray[np.int64], is_overdue: NDArray[np.bool_]) -> int | None:
        """Return the nearest overdue point."""
        overdue = points[is_overdue]
        if not overdue.size:
            return None
        row, col = view.point_of((view.pose.x, view.pose.y))
        away = (overdue // self._width - row) ** 2 + (overdue % self._width - col) ** 2
        return int(overdue[away.argmin()])
