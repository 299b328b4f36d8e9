"""The other robots of the fleet, as the fence needs them: where each is likely to be in a moment."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from patrol.radio.peers import Peer

CARRIED_S = 1.0
"""For how long a robot is taken to go on as it went, s; after that it is taken to stand where that led."""

MOST_TICKS = 4
"""Positions that are further apart say nothing of a robot's velocity."""


@dataclass(frozen=True, slots=True)
class Other:
    """Another robot."""

    x: float  # m, `since_s` ago
    y: float  # m
    vx: float  # m/s, on the map
    vy: float  # m/s
    radius: float  # of its body, m
    since_s: float

    @property
    def speed(self) -> float:
        """m/s."""
        return math.hypot(self.vx, self.vy)

    def distance(self, x: float, y: float, ahead_s: float) -> float:
        """Return the distance in m of the robot's centre from a place, `ahead_s` from now."""
        gone_s = min(self.since_s + ahead_s, CARRIED_S)
        return math.hypot(self.x + self.vx * gone_s - x, self.y + self.vy * gone_s - y)


@dataclass(slots=True)
class _Seen:
    peer: Peer
    vx: float
    vy: float
    at_s: float


class Others:
    """Follows the other robots, heard in `peers`, which goes on to change.

    Radii are in m, `step` is in s per tick. `foreseen` returns where the others should be that many ticks from now; it
    is None where the fleet's robots do not predict each other. Robots that do are silent while the others foresee them
    well enough.
    """

    def __init__(
        self,
        peers: Mapping[int, Peer],
        radii: Mapping[int, float],
        step: float,
        foreseen: Callable[[int], Mapping[int, Peer]] | None = None,
    ) -> None:
        self._peers = peers
        self._radii = radii
        self._step = step
        self._foreseen = foreseen
        self._seen: dict[int, _Seen] = {}

    def look(self, now_s: float) -> None:
        """Take in what has been heard for this tick."""
        if self._foreseen is not None:
            after = self._foreseen(1)
            for number, peer in self._foreseen(0).items():
                vx, vy = _velocity(peer, after[number], self._step)
                self._seen[number] = _Seen(peer, vx, vy, now_s)
            return
        for number, peer in self._peers.items():
            last = self._seen.get(number)
            ticks = 0 if last is None else peer.sequence - last.peer.sequence
            if last is not None and ticks == 0:
                continue
            vx = vy = 0.0
            if last is not None and 0 < ticks <= MOST_TICKS:
                vx, vy = _velocity(last.peer, peer, ticks * self._step)
            self._seen[number] = _Seen(peer, vx, vy, now_s)

    def around(self, now_s: float) -> tuple[Other, ...]:
        """Return all other robots that were heard."""
        return tuple(
            Other(one.peer.pose.x, one.peer.pose.y, one.vx, one.vy, self._radii[number], max(0.0, now_s - one.at_s))
            for number, one in self._seen.items()
        )


def _velocity(before: Peer, after: Peer, time_s: float) -> tuple[float, float]:
    return (after.pose.x - before.pose.x) / time_s, (after.pose.y - before.pose.y) / time_s
