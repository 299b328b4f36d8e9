"""The other robots of a plan: they are where the plan has them, as long as they are heard to keep to it.

One that was heard where the plan had it some ticks before is so much late, and as late from then on.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from patrol.pose import Pose
from patrol.radio.peers import Peer, columns_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from agent.policies.common_plan.plan import CommonPlan
    from agent.view import View

OFF = 1.0
"""A robot is off the plan where it is farther from where the plan has had it lately, in its strides."""

LATE = 0.4
"""How late a robot may be while it is on the plan, in times between two robots on the tour."""

SAME = 0.1
"""Cost of a tick by which it is later or earlier than it was before, in strides."""

NEARBY = 30.0
"""Robots farther away than so many strides are of no account."""


class Others:
    """The other robots of one plan, as one robot knows them; those of no plan are where they were heard."""

    def __init__(self, plan: CommonPlan, number: int) -> None:
        """Take all to keep to the plan."""
        self._plan = plan
        self._numbers = np.array([other for other in plan.rows if other != number], dtype=np.int64)
        self._heard_at = np.full(self._numbers.size, -1)  # the newest sequence of each
        self._is_off = np.zeros(self._numbers.size, dtype=np.bool_)
        self._late = np.zeros(self._numbers.size, dtype=np.int64)  # ticks
        self._most = round(LATE * plan.interval_s / plan.step)
        self._forgotten = round(plan.interval_s / plan.step)  # ticks; other robots may have worked the plan out further
        self._strides = {spec.number: spec.speed * plan.step for spec in plan.robots}

    def note(self, view: View) -> Mapping[int, Peer] | None:
        """Take note of who is heard; return where others nearby are now, None where all are heard now."""
        plan, peers = self._plan, columns_of(view.peers)
        sequences = np.full(self._numbers.size, -1)
        rows = np.searchsorted(self._numbers, peers.numbers)
        # One beyond the last is of no plan.
        is_planned = np.append(self._numbers, -1)[rows] == peers.numbers
        sequences[rows[is_planned]] = peers.sequences[is_planned]
        for index in np.flatnonzero(sequences > self._heard_at).tolist():
            self._judge(index, view)
        expected = self._numbers[~self._is_off & (sequences < view.tick)].tolist()
        if not expected:
            return None
        away_m = np.sqrt(((peers.places - (view.reported.x, view.reported.y)) ** 2).sum(axis=1))
        nearby = peers.numbers[away_m <= NEARBY * max(self._strides.values())].tolist()
        others = {number: view.peers[number] for number in nearby}
        for number in expected:
            tick = max(view.tick - int(self._late[self._numbers == number][0]), plan.origin)
            ((x, y, heading),) = plan.poses(number, tick, tick + 1).tolist()
            others[number] = Peer(view.tick, Pose(x, y, heading), view.tick)
        return others

    def _judge(self, index: int, view: View) -> None:
        """Note whether a robot that has been heard is on the plan, and how late."""
        number, plan = int(self._numbers[index]), self._plan
        peer = view.peers[number]
        self._heard_at[index] = peer.sequence
        first = max(peer.tick - self._most, view.tick - self._forgotten, plan.origin)
        if first > peer.tick:
            return
        places = plan.poses(number, first, peer.tick + 1)[:, :2]
        off = np.sqrt(((places - (peer.pose.x, peer.pose.y)) ** 2).sum(axis=1)) / self._strides[number]
        late = peer.tick - np.arange(first, peer.tick + 1)
        best = int((off + SAME * abs(late - self._late[index])).argmin())
        # A position that took its time was moved on, straight.
        self._is_off[index] = off[best] > OFF + peer.tick - peer.sequence
        self._late[index] = 0 if self._is_off[index] else late[best]
