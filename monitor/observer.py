"""What somebody who only listens knows of a patrol.

The monitor is one more listener: it rebuilds the fog from the positions it hears, with the same checks, the same
footprints and the same fog as any robot, so no map is ever sent and nothing changes on a real fleet.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from monitor.source import OUTSIDE
from patrol.ground.fog import Fog
from patrol.pose import Pose
from patrol.radio.inbox import Inbox
from patrol.radio.message import CONTACT, Position
from patrol.radio.peers import PeerTracker

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from patrol.ground.footprint import Footprint

NOBODY = -1
"""The own number of a listener that is no robot."""


def as_sent(number: int, pose: Pose) -> Pose:
    """A pose as others hear it (cm, mrad); every footprint is computed from it."""
    return Position.of(number, 0, 0.0, pose).pose


def keep_outside(fog: Fog, patrolled: NDArray[np.bool_]) -> Fog:
    """The fog, in which the fleet's patrolled points, bool (h, w), that do not count for it say so (`OUTSIDE`).

    They never change: an observation leaves alone what does not count.
    """
    fog.last_seen[patrolled & (fog.patrolled == 0)] = OUTSIDE
    return fog


class Listener:
    """The fog that follows from positions heard, as a robot believes it before any dilatation.

    patrolled: bool (h, w), the points that count. inbox: what decides which frames to believe. step: s.
    """

    def __init__(self, footprint: Footprint, patrolled: NDArray[np.bool_], inbox: Inbox, step: float) -> None:
        self.fog = Fog(patrolled)
        self.inbox = inbox
        self._tracker = PeerTracker()
        self.peers = self._tracker.peers
        self._footprint = footprint
        self._step = step

    def look(self, tick: int, pose: Pose) -> None:
        """Somebody looks around from a pose as encoded on the wire."""
        self.fog.observe(self._footprint.visible(pose), tick)

    def hear(self, tick: int, frames: Iterable[bytes]) -> None:
        """Take in the frames that come at `tick`; those that cannot be true are counted in the inbox and dropped."""
        for frame in frames:
            position = self.inbox.accept(frame, tick * self._step)
            if position is None or position.robot == CONTACT:
                continue
            for at, pose in self._tracker.hear(position, tick):
                self.look(at, pose)
