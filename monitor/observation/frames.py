"""The frames that were sent in a tick, and the poses in them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping

from monitor.observation.listener import as_sent
from patrol.journal.records import TickRecord, frame_sequence
from patrol.pose import Pose
from patrol.radio.message import Rejected, decode

MIND_ENDS = frozenset({"dead", "lost", "left"})
"""Events at which a robot's mind ends; a robot that returns starts without knowledge."""


def frames_of(record: TickRecord) -> dict[tuple[int, int], bytes]:
    """Return the encoded frames sent in a tick, by number of the sender and sequence."""
    frames: dict[tuple[int, int], bytes] = {}
    places: dict[int, int] = defaultdict(int)
    for source, frame in record.frames:
        frames[source, frame_sequence(record.k, places[source])] = frame
        places[source] += 1
    return frames


def own_pose(k: int, number: int, frames: Mapping[tuple[int, int], bytes], true: Pose) -> Pose:
    """Return the pose that a robot believes to be its own, quantised as on the wire.

    It comes from the position that the robot sent, among the tick's frames from `frames_of`; the true pose is used
    where it sent none.
    """
    frame = frames.get((number, frame_sequence(k, 0)))
    try:
        if frame is not None and (position := decode(frame)).robot == number:
            return position.pose
    except Rejected:
        pass
    return as_sent(number, true)
