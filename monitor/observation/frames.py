"""A tick's radio frames as the journal records them: which were sent, and how many by directed link.

A frame counts once for each receiver and each copy, contacts included, as in a run's summary.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monitor.observation.listener import as_sent
from patrol.journal.records import TickRecord, frame_sequence
from patrol.pose import Pose
from patrol.radio.message import Rejected, decode
from patrol.summary.totals import is_present

MIND_ENDS = frozenset({"dead", "lost", "left"})
"""Events at which a robot's mind ends; a robot that returns starts without knowledge."""


def frames_of(record: TickRecord) -> dict[tuple[int, int], bytes]:
    """The frames sent in a tick.

    Args:
        record: The tick.

    Returns:
        Encoded frames by (robot number of the sender, sequence).
    """
    frames: dict[tuple[int, int], bytes] = {}
    places: dict[int, int] = defaultdict(int)
    for source, frame in record.frames:
        frames[source, frame_sequence(record.k, places[source])] = frame
        places[source] += 1
    return frames


def own_pose(k: int, number: int, frames: Mapping[tuple[int, int], bytes], true: Pose) -> Pose:
    """Where a robot believes itself to be, from the position that it sent.

    Args:
        k: The tick.
        number: The robot's number.
        frames: The tick's frames, from `frames_of`.
        true: The robot's true pose, used when it sent no position.

    Returns:
        The pose, quantised as on the wire.
    """
    frame = frames.get((number, frame_sequence(k, 0)))
    try:
        if frame is not None and (position := decode(frame)).robot == number:
            return position.pose
    except Rejected:
        pass
    return as_sent(number, true)


def count_frames(
    record: TickRecord, place: Mapping[int, int], sent: NDArray[np.integer[Any]], delivered: NDArray[np.integer[Any]]
) -> None:
    """Add one tick to the counts of sent and delivered frames.

    Args:
        record: The tick.
        place: Row and column of each robot in the counts, by robot number. Robots without a place are not counted;
            `patrol.journal.records.FORGED` is counted as a sender if it has a place.
        sent: Integers (n, n), sender by receiver; changed in place. Counts every frame sent, also those delivered or
            dropped in a later tick.
        delivered: Integers (n, n), sender by receiver; changed in place.
    """
    here = [place[row.number] for row in record.robots if is_present(row.status) and row.number in place]
    for source, frames in Counter(source for source, _ in record.frames).items():
        if source in place:
            origin = place[source]
            sent[origin, [to for to in here if to != origin]] += frames
    for source, to, _, _ in record.copies:
        if source in place and to in place:
            sent[place[source], place[to]] += 1
    for source, to, _ in record.deliveries:
        if source in place and to in place:
            delivered[place[source], place[to]] += 1
