"""How frames are counted by directed link: once for each receiver and each copy, contacts too, as a summary does."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from patrol.journal.records import Status, TickRecord

_NO_BODY = (Status.ABSENT, Status.LEFT)


def tally(
    record: TickRecord, place: Mapping[int, int], sent: NDArray[np.integer[Any]], delivered: NDArray[np.integer[Any]]
) -> None:
    """Add one tick to counts by (source, destination).

    place: rows and columns by robot number; whoever has none does not count, and `patrol.journal.records.FORGED` is a
    sender
    like any other if it has one. sent: of all frames, so also of those that will be delivered or dropped later.
    """
    here = [place[row.number] for row in record.robots if row.status not in _NO_BODY and row.number in place]
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
