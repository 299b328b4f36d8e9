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

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from patrol.closures.ground import Closings
    from patrol.ground.footprint import Footprint

NO_ROBOT = -1
"""The number of a listener that is not a robot."""


def mark_outside(fog: Fog, patrolled: NDArray[np.bool_]) -> Fog:
    """Set the points that the fleet patrols but this fog does not count to `OUTSIDE`, in place.

    Observations never change points that the fog does not count, so the marks stay. The same fog is returned.
    """
    fog.last_seen[patrolled & (fog.patrolled == 0)] = OUTSIDE
    return fog


class Listener:
    """The fog that follows from heard positions, as a robot believes it before dilatation.

    `peers` has the newest position heard of each robot, by robot number.
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

        `patrolled` has the points that count, bool (h, w). `number` is that of the inbox to use, which decides which
        frames to accept. `closings` is None where nothing is ever closed.
        """
        self.fog = Fog(patrolled)
        self.inboxes = inboxes
        self.number = number
        self.peers = inboxes.peers(number)
        self._footprint = footprint
        self._closings = closings

    def look(self, tick: int, pose: Pose) -> None:
        """Apply one observation, from a pose that is quantised as on the wire."""
        if self._closings is not None:
            self._closings.show(tick, self._footprint)
        self.fog.observe(self._footprint.visible(pose), tick)

    def hear(self, tick: int, frames: Sequence[bytes]) -> None:
        """Apply the observations that received positions report.

        `tick` is the one in which the frames arrive. The inbox counts and drops the invalid ones.
        """
        for look_tick, pose in self.inboxes.hear(tick, {self.number: frames}).looks(self.number):
            self.look(look_tick, pose)
