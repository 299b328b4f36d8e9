"""The links of a running fleet, counted tick by tick from the time at which the viewer began to watch."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from monitor.observation.source import LinkCounts
from patrol.journal.records import FORGED, TickRecord
from patrol.summary.totals import count_frames


class LiveLinks:
    """Counts frames by link.

    `heard` has, by robot number, the tick in which another robot last heard the robot. Where that is unknown, or there
    is no other robot, it has the tick in which the robot last sent.
    """

    def __init__(self, numbers: Sequence[int], since: int, *, direct: bool) -> None:
        """Start without frames; they are counted from tick `since` on.

        `numbers` are in roster order. With `direct`, robots hear each other directly, and only what was sent is known.
        """
        side = (len(numbers),) * 2
        self.counts = LinkCounts(np.zeros(side, np.int64), np.zeros(side, np.int64), np.full(side, -1, np.int64), since)
        self.heard: dict[int, int] = {}
        self._place = {number: index for index, number in enumerate(numbers)}
        self._direct = direct

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        index_of, counts = self._place, self.counts
        count_frames(record, index_of, counts.sent, counts.delivered)
        for source, to, _ in record.deliveries:
            if source != FORGED:
                counts.heard[index_of[source], index_of[to]] = record.k
                self.heard[source] = record.k
        here = sum(row.status.is_present for row in record.robots)
        if self._direct or here == 1:
            self.heard.update({source: record.k for source, _ in record.frames if source != FORGED})
