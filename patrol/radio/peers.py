"""Where the other robots are and from where they have observed, according to the positions heard of them.

Every listener that hears the same positions comes to the same result.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from patrol.pose import Pose
from patrol.radio.message import Position
from patrol.radio.replay_window import SPAN, ReplayWindow


@dataclass(frozen=True, slots=True)
class Peer:
    """Another robot.

    Attributes:
        sequence: Its newest.
        pose: There, m and rad.
        tick: At which that was heard.
    """

    sequence: int
    pose: Pose
    tick: int


def places_of(peers: Mapping[int, Peer]) -> NDArray[np.float64]:
    """Where some robots are, by number.

    Args:
        peers: a mapping that has them as columns, `places`, or any other.

    Returns:
        float64 (n, 2), x and y in m.
    """
    columns: NDArray[np.float64] | None = getattr(peers, "places", None)
    if columns is not None:
        return columns
    places = [(peer.pose.x, peer.pose.y) for _, peer in sorted(peers.items())]
    return np.array(places, dtype=np.float64).reshape(-1, 2)


class PeerTracker:
    """Follows the other robots through accepted positions, and counts each of their observations once.

    Attributes:
        peers: By robot number, the newest position heard.
        said: By robot number, the frame that gave it.

    Args:
        trail_every: Ticks between the places of a trail.
    """

    def __init__(self, trail_every: int = 1) -> None:
        self.peers: dict[int, Peer] = {}
        self.said: dict[int, Position] = {}
        self._trail_every = trail_every
        self._looks: dict[int, ReplayWindow] = {}

    def release(self, robot: int) -> tuple[Peer, Position, ReplayWindow] | None:
        """Forget a robot.

        Args:
            robot: Its number.

        Returns:
            What was known of it and which of its observations are counted; None where it had not been heard.
        """
        if robot not in self.peers:
            return None
        return self.peers.pop(robot), self.said.pop(robot), self._looks.pop(robot)

    def resume(self, peer: Peer, said: Position, looks: ReplayWindow) -> None:
        """Go on from what was known of a robot.

        Args:
            peer: From `release`.
            said: From `release`.
            looks: From `release`.
        """
        self.peers[said.robot], self.said[said.robot], self._looks[said.robot] = peer, said, looks

    def hear(self, position: Position, tick: int) -> Iterator[tuple[int, Pose]]:
        """The observations that an accepted position makes known.

        A position counts at the tick it arrives: robots' clocks need not agree. A late one, which is older than the
        newest of its sender's, counts as many ticks before that one's as their sequences are apart, and moves nobody.
        One that is older than any window corrects its sender's sequence, and the sender's window begins anew.

        Args:
            position: Accepted by the inbox.
            tick: At which it arrived.

        Yields:
            (tick, pose) of each observation that is new.
        """
        newest = self.peers.get(position.robot)
        ago = 0 if newest is None else newest.sequence - position.sequence
        if newest is not None and 0 < ago < SPAN:
            tick = newest.tick - ago
        else:
            if ago >= SPAN:
                del self._looks[position.robot]
            self.peers[position.robot] = Peer(position.sequence, position.pose, tick)
            self.said[position.robot] = position
        # The trail fills what was missed: its i-th place is where the sender was i times `trail_every` sequences ago.
        places = [(position.pose.x, position.pose.y), *position.past]
        looks = self._looks.setdefault(position.robot, ReplayWindow())
        for place, (x, y) in enumerate(places):
            ago = place * self._trail_every
            # An observation counts once, however often it is reported: with quality below 1 a second would change ages.
            if ago <= min(tick, position.sequence) and looks.use(position.sequence - ago):
                yield tick - ago, Pose(x, y, position.pose.heading)
