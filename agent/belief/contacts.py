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
        place = contact.pose.x, contact.pose.y
        self._seen = {other: k for other, k in self._seen.items() if k == tick or math.dist(other, place) >= SAME}
        if all(math.dist(other, place) >= SAME for other in self._seen):
            self._seen[place] = tick

    def known(self, tick: int, memory: int) -> list[Place]:
        """Return the places of the intruders reported within the last `memory` ticks, ascending."""
        if not self._seen:
            return []
        self._seen = {place: k for place, k in self._seen.items() if tick - k <= memory}
        return sorted(self._seen)
