"""Frame counts of each link: live, from the tick at which the viewer began to watch, and of a run that is over."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

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


_APART = 64
"""Ticks of a block. Its counts are compressed together, and their sums are stored at its end."""

_FAST = 1
"""Compression level. Most ticks of a block are alike, so higher levels gain little."""

_Counts = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]


class LinkLog:
    """Frame counts at any tick of a run, from `patrol.summary.totals`; forged frames do not count.

    Those of each tick are compressed, and their sums are kept at regular intervals.
    """

    def __init__(self, index: Mapping[int, int]) -> None:
        """Start with nothing read; `index` has the place of each robot by its number."""
        self._index = index
        side = len(index)
        self._shape = (2, side, side)
        self._ticks = 0
        self._packed: list[bytes] = []
        self._open: list[NDArray[np.uint16]] = []
        self._block_of = -1
        self._block = np.zeros((0, *self._shape), dtype=np.uint16)
        zeros = np.zeros((side, side), dtype=np.int64)
        self._counts: list[_Counts] = [(zeros, zeros, zeros - 1)]

    def at(self, k: int) -> LinkCounts | None:
        """Return the counts up to tick k; None while the journal is not read that far."""
        return LinkCounts(*self._counts_after(k)) if k < self._ticks else None

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        counts = np.zeros(self._shape, dtype=np.uint16)
        count_frames(record, self._index, *counts)
        self._open.append(counts)
        self._ticks += 1
        if len(self._open) == _APART:
            self._counts.append(self._counts_after(self._ticks - 1))
            self._packed.append(zlib.compress(np.stack(self._open).tobytes(), _FAST))
            self._open.clear()

    def _counts_after(self, k: int) -> _Counts:
        """Return the frames sent and delivered, and when each link was last heard, after tick k.

        For example, tick 130 takes the sums up to tick 127, two blocks of 64, and adds the ticks 128 to 130.
        """
        number = k // _APART
        sent, delivered, last_heard = self._counts[number]
        first = number * _APART
        # Only up to the tick: a block goes on after it.
        rows = self._block_rows(number)[: k + 1 - first]
        came = rows[:, 1] > 0
        last = np.where(came.any(axis=0), first + len(rows) - 1 - came[::-1].argmax(axis=0), last_heard)
        also_sent, arrived = rows.sum(axis=0, dtype=np.int64)
        return sent + also_sent, delivered + arrived, last

    def _block_rows(self, number: int) -> NDArray[np.uint16]:
        """uint16 (ticks, 2, n, n): frames sent and delivered in each tick of a block."""
        if number == len(self._packed):
            return np.stack(self._open)
        # The block read last is kept: a replay asks for one tick after the other.
        if number != self._block_of:
            counts = np.frombuffer(zlib.decompress(self._packed[number]), dtype=np.uint16)
            self._block_of, self._block = number, counts.reshape(-1, *self._shape)
        return self._block
