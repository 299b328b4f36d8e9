"""The fog as known to a member that only listens.

The listener rebuilds the fog from the positions that it hears, with the same checks, footprints and fog as any robot.
So no map is ever sent, and watching changes nothing on a real fleet.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from monitor.observation.source import OUTSIDE
from patrol.ground.fog import Fog
from patrol.pose import Pose
from patrol.radio.inbox import Inboxes
from patrol.radio.message import Position

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from patrol.closures import Closings
    from patrol.ground.footprint import Footprint

NO_ROBOT = -1
"""The number of a listener that is not a robot."""


def as_sent(number: int, pose: Pose) -> Pose:
    """Return a pose as other robots receive it; every footprint is computed from it.

    Args:
        number: The robot's number.
        pose: The exact pose.

    Returns:
        The pose quantised as on the wire (cm, mrad).
    """
    return Position.of(number, 0, 0.0, pose).pose


def mark_outside(fog: Fog, patrolled: NDArray[np.bool_]) -> Fog:
    """Set the points that the fleet patrols but this fog does not count to `OUTSIDE`.

    Observations never change points that the fog does not count, so the marks stay.

    Args:
        fog: The fog of one robot; changed in place.
        patrolled: bool (h, w), the points that the fleet patrols.

    Returns:
        The same fog.
    """
    fog.last_seen[patrolled & (fog.patrolled == 0)] = OUTSIDE
    return fog


class Listener:
    """The fog that follows from heard positions, as a robot believes it before dilatation.

    Attributes:
        fog: The fog.
        inboxes: Decide which frames are accepted.
        peers: The newest position heard of each robot, by robot number.
    """

    def __init__(
        self,
        footprint: Footprint,
        patrolled: NDArray[np.bool_],
        inboxes: Inboxes,
        number: int,
        closings: Closings | None = None,
    ) -> None:
        """Start without knowledge.

        Args:
            footprint: The sensor's footprint on this terrain.
            patrolled: bool (h, w), the points that count.
            inboxes: Decide which frames to accept.
            number: Of the inbox to use.
            closings: What was closed in each tick; None where nothing ever is.
        """
        self.fog = Fog(patrolled)
        self.inboxes = inboxes
        self.number = number
        self.peers = inboxes.peers(number)
        self._footprint = footprint
        self._closings = closings

    def look(self, tick: int, pose: Pose) -> None:
        """Apply one observation.

        Args:
            tick: The tick of the observation.
            pose: The observer's pose, quantised as on the wire.
        """
        if self._closings is not None:
            self._closings.show(tick, self._footprint)
        self.fog.observe(self._footprint.visible(pose), tick)

    def hear(self, tick: int, frames: Sequence[bytes]) -> None:
        """Apply the observations that received positions report.

        Args:
            tick: The tick in which the frames arrive.
            frames: Encoded frames. The inbox counts and drops the invalid ones.
        """
        for look_tick, pose in self.inboxes.hear(tick, {self.number: frames}).looks(self.number):
            self.look(look_tick, pose)
