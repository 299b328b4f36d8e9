"""Contacts: where intruders are, as far as a robot knows from its own sensor and from what others report."""

from __future__ import annotations

import math

from patrol.radio.message import Position

SAME = 2.0
"""Reports nearer to each other than this (m) are of one intruder."""

Place = tuple[float, float]
"""x and y in m."""


class Contacts:
    """The last report of each intruder."""

    def __init__(self) -> None:
        self._seen: dict[Place, int] = {}

    def report(self, contact: Position, tick: int) -> None:
        """Somebody sees an intruder at ``tick``; earlier reports of the same one are forgotten."""
        place = contact.pose.x, contact.pose.y
        self._seen = {other: at for other, at in self._seen.items() if at == tick or math.dist(other, place) >= SAME}
        if all(math.dist(other, place) >= SAME for other in self._seen):
            self._seen[place] = tick

    def known(self, tick: int, memory: int) -> list[Place]:
        """The intruders reported at most ``memory`` ticks before ``tick``, by place."""
        self._seen = {place: at for place, at in self._seen.items() if tick - at <= memory}
        return sorted(self._seen)
