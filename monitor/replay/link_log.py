"""Frame counts of each link at any tick of a run: compressed counts for each tick, and sums at regular intervals."""

from __future__ import annotations

import zlib
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from monitor.observation.source import LinkCounts
from patrol.journal.records import TickRecord
from patrol.summary.totals import count_frames

_APART = 64
"""Ticks of a block. Its counts are compressed together, and their sums are stored at its end."""

_FAST = 1
"""Compression level. Most ticks of a block are alike, so higher levels gain little."""

_Counts = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]


class LinkLog:
    """Frame counts at any tick, from `patrol.summary.totals`; forged frames do not count."""

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
        """Return the frames sent and delivered, and when each link was last heard, after tick k."""
        number = k // _APART
        sent, delivered, last_heard = self._counts[number]
        first = number * _APART
        rows = self._block_rows(number)[: k + 1 - first]
        came = rows[:, 1] > 0
        last = np.where(came.any(axis=0), first + len(rows) - 1 - came[::-1].argmax(axis=0), last_heard)
        also_sent, arrived = rows.sum(axis=0, dtype=np.int64)
        return sent + also_sent, delivered + arrived, last

    def _block_rows(self, number: int) -> NDArray[np.uint16]:
        """uint16 (ticks, 2, n, n): frames sent and delivered in each tick of a block."""
        if number == len(self._packed):
            return np.stack(self._open)
        if number != self._block_of:
            counts = np.frombuffer(zlib.decompress(self._packed[number]), dtype=np.uint16)
            self._block_of, self._block = number, counts.reshape(-1, *self._shape)
        return self._block
