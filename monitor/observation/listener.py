"""The fogs of members that listen, and those that robots believe, from the frames that each sent and received.

A listener rebuilds the fog from the positions that it hears, with the same checks, footprints and fog as any robot.
So no map is ever sent, and watching changes nothing on a real fleet.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING

from monitor.observation.source import OUTSIDE
from patrol.ground.fog import Fog
from patrol.journal.records import Status, TickRecord, frame_sequence, sent_at
from patrol.pose import Pose
from patrol.radio.inbox import Inboxes
from patrol.radio.message import Rejected, as_received, decode

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from patrol.changing.ground import Closings
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


GONE = frozenset({Status.ABSENT, Status.DEAD, Status.LOST, Status.LEFT})
"""Status of robots without a mind; one that returns starts without knowledge."""

Frames = dict[tuple[int, int], bytes]
"""The encoded frames of a tick, by number of the sender and sequence."""


class BeliefFollower:
    """Follows the robots' beliefs, before dilatation; `listeners` has the fog of each, by robot number."""

    def __init__(self, numbers: Collection[int], make: Callable[[int], Listener], kept_ticks: int) -> None:
        """Start without knowledge.

        `make` gives a robot's listener as its mind begins. Frames are kept for so many ticks, for late deliveries.
        """
        self._make = make
        self._past: deque[tuple[int, Frames]] = deque(maxlen=kept_ticks)
        self._was = dict.fromkeys(numbers, Status.ALIVE)
        self.listeners = {number: make(number) for number in numbers}

    def tick(self, record: TickRecord, ended: Collection[int] = ()) -> None:
        """Take in the next tick; the minds of the robots in `ended` have ended since the last one."""
        frames = _frames_of(record)
        self._past.append((record.k, frames))
        delivered = self._frames_by_robot(record)
        for row in record.robots:
            number = row.number
            if number not in self.listeners:
                continue
            # A robot may end and begin again between two ticks, which no status shows.
            if number in ended or (row.status not in GONE and self._was[number] in GONE):
                self.listeners[number] = self._make(number)
            self._was[number] = row.status
            if row.status is Status.ALIVE:
                pose = _own_pose(record.k, number, frames, Pose(row.x, row.y, row.heading))
                self.listeners[number].look(record.k, pose)
                self.listeners[number].hear(record.k, delivered[number])

    def _frames_by_robot(self, record: TickRecord) -> Mapping[int, list[bytes]]:
        """Return the frames that reach each robot in this tick, in the order of arrival."""
        past = dict(self._past)
        frames: dict[int, list[bytes]] = defaultdict(list)
        for source, to, sequence in record.deliveries:
            if to in self.listeners:
                frame = past.get(sent_at(sequence), {}).get((source, sequence))
                if frame is not None:
                    frames[to].append(frame)
        return frames


def _frames_of(record: TickRecord) -> Frames:
    frames: Frames = {}
    places: dict[int, int] = defaultdict(int)
    for source, frame in record.frames:
        frames[source, frame_sequence(record.k, places[source])] = frame
        places[source] += 1
    return frames


def _own_pose(k: int, number: int, frames: Frames, true: Pose) -> Pose:
    """Return the pose that a robot believes to be its own, quantised as on the wire.

    It comes from the position that the robot sent in this tick; the true pose is used where it sent none.
    """
    frame = frames.get((number, frame_sequence(k, 0)))
    try:
        if frame is not None and (position := decode(frame)).robot == number:
            return position.pose
    except Rejected:
        pass
    return as_received(true)
