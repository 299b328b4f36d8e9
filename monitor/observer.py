"""What somebody who only listens knows of a patrol, and beside it the truth where there is a world to tell it.

The monitor is one more listener: it rebuilds the fog from the positions it hears, with the same checks, the same
footprints and the same fog as any robot, so no map is ever sent and nothing changes on a real fleet.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from patrol.fog import Fog
from patrol.inbox import Inbox
from patrol.message import CONTACT, Position
from patrol.pose import Pose

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from patrol.footprint import Footprint
    from patrol.prepare import Prepared
    from patrol.scenario import Scenario
    from patrol.terrain import Terrain

NOBODY = -1
"""The own number of a listener that is no robot."""


def as_sent(number: int, pose: Pose) -> Pose:
    """A pose as others hear it (cm, mrad); every footprint is computed from it."""
    return Position.of(number, 0, 0.0, pose).pose


class Listener:
    """The fog that follows from positions heard, as a robot believes it before any dilatation.

    patrolled: bool (h, w), the points that count. inbox: what decides which frames to believe. step: s.
    """

    def __init__(self, footprint: Footprint, patrolled: NDArray[np.bool_], inbox: Inbox, step: float) -> None:
        self.fog = Fog(patrolled)
        self.inbox = inbox
        self.heard: dict[int, tuple[Position, int]] = {}
        """By robot: its newest position believed, and the tick it came at."""
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
            before = self.heard.get(position.robot)
            self.heard[position.robot] = (position, tick)
            self.look(tick, position.pose)
            # The trail fills what was missed: its i-th place is where the sender was i sequences ago.
            missed = len(position.past) if before is None else position.sequence - before[0].sequence - 1
            for ago, (x, y) in enumerate(position.past[: max(0, missed)], start=1):
                if ago <= tick:
                    self.look(tick - ago, Pose(x, y, position.pose.heading))


class Observer:
    """The fog as heard, and the true one where poses are told as well."""

    def __init__(self, prepared: Prepared, footprint: Footprint, key: bytes | None = None) -> None:
        """key: of the fleet's tags, or None where frames carry none or they cannot be checked."""
        scenario = prepared.scenario
        inbox = inbox_of(scenario, prepared.terrain, NOBODY, key)
        self.believed = Listener(footprint, prepared.patrolled, inbox, scenario.step)
        self.truth = Fog(prepared.patrolled)
        self._footprint = footprint

    def hear(self, tick: int, frames: Iterable[bytes]) -> None:
        """Take in the positions heard at `tick`."""
        self.believed.hear(tick, frames)

    def witness(self, tick: int, poses: Iterable[tuple[int, Pose]]) -> None:
        """Everyone alive, (number, true pose), looks around once, in that order."""
        for number, pose in poses:
            self.truth.observe(self._footprint.visible(as_sent(number, pose)), tick)


def inbox_of(scenario: Scenario, terrain: Terrain, own: int, key: bytes | None) -> Inbox:
    """The checks of one listener of a fleet; own: its robot number, or NOBODY."""
    fastest = max(spec.speed for spec in scenario.roster)
    return Inbox(own, [spec.number for spec in scenario.roster], terrain.bounds, fastest, key, scenario.step)
