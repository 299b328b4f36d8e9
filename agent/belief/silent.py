"""Obstacles at the last poses of robots that are no longer heard.

The body of a robot that has died stays where it is until it is removed, and others have no sensor for it. So a robot
that was not heard for a while is an obstacle where it was heard last, for a limited time. Then the place counts as free
until this robot bumps there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from agent.routes.ground import Disc
from patrol.pose import Pose
from patrol.radio.inbox import Peers


class Silent:
    """The obstacles that one robot makes of robots that it no longer hears."""

    def __init__(self, radii: Mapping[int, float], margin: float, near: float, patience: int, memory: int) -> None:
        """Begin without a bump; radii, `margin` and `near` are in m, `patience` and `memory` in ticks.

        `margin` is added to each radius: this robot's own radius and half a point. A robot unheard for more than
        `patience` counts as silent, and is forgotten `memory` after it was last heard or bumped into. A bump is into a
        silent robot whose body is at most `near` from this robot's centre.
        """
        self._radii = radii
        self._margin = margin
        self._near = near
        self._patience = patience
        self._memory = memory
        self._heard_since = 0
        self._bumped_at: dict[int, int] = {}

    def discs(self, tick: int, pose: Pose, bumped: bool, peers: Peers) -> list[Disc]:
        """Return discs around the last poses of the silent robots, but for those that this robot itself stands in."""
        if tick - self._heard_since <= self._patience:
            return []
        # A robot that is heard again, or for the first time, is heard later than now.
        self._heard_since = peers.oldest(tick)
        if tick - self._heard_since <= self._patience:
            return []
        found = []
        for number in peers.silent(tick - self._patience):
            peer, radius = peers[number], self._radii[number]
            apart = math.hypot(peer.pose.x - pose.x, peer.pose.y - pose.y)
            if bumped and apart <= radius + self._near:
                self._bumped_at[number] = tick
            met = max(peer.tick, self._bumped_at.get(number, 0))
            if tick - met <= self._memory and apart >= radius + self._margin:
                found.append((peer.pose.x, peer.pose.y, radius + self._margin))
        return found
