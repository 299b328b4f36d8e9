"""Contacts: places of intruders, from the robot's own sensor and from the reports of others."""

from __future__ import annotations

import math

from patrol.radio.message import Position

SAME = 2.0
"""Two reports closer together than this (m) are of the same intruder."""

Place = tuple[float, float]
"""x and y in m."""


class Contacts:
    """The last report of each intruder."""

    def __init__(self) -> None:
        self._seen: dict[Place, int] = {}

    def report(self, contact: Position, tick: int) -> None:
        """Take in a report and forget earlier reports of the same intruder."""
        spot = contact.pose.x, contact.pose.y
        self._seen = {earlier: k for earlier, k in self._seen.items() if k == tick or math.dist(earlier, spot) >= SAME}
        if all(math.dist(earlier, spot) >= SAME for earlier in self._seen):
            self._seen[spot] = tick

    def known(self, tick: int, memory: int) -> list[Place]:
        """Return the places of the intruders reported within the last `memory` ticks, ascending."""
        if not self._seen:
            return []
        self._seen = {spot: k for spot, k in self._seen.items() if tick - k <= memory}
        return sorted(self._seen)
