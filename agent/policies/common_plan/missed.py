"""Points that a robot has missed of its part of the plan: its planned robot saw them from where it has not been."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from agent.policies.pursuit import Target, age_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from agent.policies.common_plan.plan import CommonPlan
    from agent.policies.pursuit import GivenUp
    from agent.ports import PolicySetup
    from agent.view import View

OVERDUE = 2.0
"""A missed point is gone to after so many times the time between two robots on the tour, unless the plan leads there
within the next one. One that was missed twice, as where something stands in the way of the plan, is gone to at once."""


class Missed:
    """The points that one robot has missed of its plans."""

    def __init__(self, setup: PolicySetup) -> None:
        """Begin with none."""
        self._fields, self._terrain = setup.ground.fields, setup.ground.terrain
        self._number = setup.robot.spec.number
        self._plan: CommonPlan | None = None
        # Flat indices; when they should have been seen first and last; and whether they were missed twice.
        self._points, self._due, self._last = np.empty((3, 0), dtype=np.int64)
        self._again = np.empty(0, dtype=np.bool_)
        self._chosen: int | None = None

    def take_up(self, plan: CommonPlan, tick: int) -> None:
        """Take part in a plan from now on; what another plan has shown before counts no longer."""
        if plan is not self._plan:
            self._plan, self._interval = plan, plan.interval_s / plan.step  # in ticks
            self._last[:] = tick

    def skip(self, first: int, until: int, view: View) -> None:
        """Note what is seen in the plan at some ticks in a row that the robot has left out."""
        plan, last_seen = self._plan, view.fog.last_seen.reshape(-1)
        assert plan is not None
        for tick in range(max(first, plan.since), until):
            seen = plan.seen_by(self._number, tick)
            unseen = seen[last_seen[seen] < tick]
            if not unseen.size:
                continue
            is_unseen = np.isin(self._points, unseen)
            self._again |= is_unseen & (tick - self._due > 0.5 * self._interval)
            self._last[is_unseen] = tick
            new = np.setdiff1d(unseen, self._points)
            self._points = np.append(self._points, new)
            self._last = np.append(self._last, np.full(new.size, tick))
            self._due = np.append(self._due, np.full(new.size, tick))
            self._again = np.append(self._again, np.zeros(new.size, dtype=np.bool_))

    def find(self, view: View, given_up: GivenUp) -> Target | None:
        """Return the point to go to now, the same until it has been seen; None where nothing is overdue."""
        plan, points, due = self._plan, self._points, self._due
        if plan is None or not points.size:
            return None
        seen, patrolled = view.fog.last_seen.reshape(-1)[points], view.fog.patrolled.reshape(-1)[points]
        stands = self._fields.stands_for(points)
        # What another one of the plan has seen since is not missed, though its position may have been lost.
        planned = plan.last_seen.reshape(-1)[points]
        is_shown = (planned > self._last) & (planned <= view.tick) & plan.seen_by_others(self._number, points)
        is_left = (seen < due) & patrolled & (stands >= 0) & ~is_shown
        if given_up.now(view.tick).size:
            is_left &= ~given_up.covers(view.tick, stands, self._terrain.width)
        self._points, self._due, self._last = points[is_left], due[is_left], self._last[is_left]
        self._again = self._again[is_left]
        if self._chosen is None or self._chosen not in self._points:
            is_ahead = planned[is_left] > view.tick
            is_due = (view.tick - self._due > OVERDUE * self._interval) & ~is_ahead
            overdue = self._points[is_due | self._again]
            self._chosen = self._find_nearest(view, overdue) if overdue.size else None
        if self._chosen is None:
            return None
        width = self._terrain.width
        point, (stand,) = divmod(self._chosen, width), self._fields.stands_for(np.array([self._chosen])).tolist()
        return Target(point, divmod(stand, width), max(age_of(view, point), 1))

    def _find_nearest(self, view: View, points: NDArray[np.int64]) -> int:
        row, col = view.point_of((view.pose.x, view.pose.y))
        away = (points // self._terrain.width - row) ** 2 + (points % self._terrain.width - col) ** 2
        return int(points[away.argmin()])
