"""Frames by directed link; a frame counts once for each receiver, and so does each copy that a fault makes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from patrol.journal.records import TickRecord


def count_frames(
    record: TickRecord, place: Mapping[int, int], sent: NDArray[np.integer[Any]], delivered: NDArray[np.integer[Any]]
) -> None:
    """Add one tick to `sent` and `delivered`, the counts (n, n) of frames, sender by receiver, in place.

    `place` is the row and column of each robot, by robot number. Robots without a place are not counted;
    `patrol.journal.records.FORGED` is counted as a sender if it has a place. `sent` counts every frame sent, also those
    delivered or dropped in a later tick.
    """
    present = [place[row.number] for row in record.robots if row.status.is_present and row.number in place]
    for source, frames in Counter(source for source, _ in record.frames).items():
        if source in place:
            origin = place[source]
            sent[origin, [to for to in present if to != origin]] += frames
    for source, to, _, _ in record.copies:
        if source in place and to in place:
            sent[place[source], place[to]] += 1
    for source, to, _ in record.deliveries:
        if source in place and to in place:
            delivered[place[source], place[to]] += 1
