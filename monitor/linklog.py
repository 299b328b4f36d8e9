"""How each link of a run stood at any tick: a bit for each link and tick, and counts now and then."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from monitor.runs import Run
from monitor.source import Links

BUDGET_S = 0.02
"""Wall time that is given at once to reading the journal."""

_APART = 64
"""Ticks between two counts."""

_Counts = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]


class LinkLog:
    """Links at any tick. Forged frames and contacts do not count, nor does a second copy of a frame."""

    def __init__(self, run: Run, now: Callable[[], float] = time.monotonic) -> None:
        self._run = run
        self._now = now
        self._side = len(run.numbers)
        self._records = iter(run.journal.ticks)
        self._rows: list[tuple[NDArray[np.uint8], NDArray[np.uint8]]] = []
        zeros = np.zeros((self._side, self._side), dtype=np.int64)
        self._counts: list[_Counts] = [(zeros, zeros, zeros - 1)]

    def at(self, k: int) -> Links | None:
        """Up to tick k; None as long as the journal is not read that far (`reach`)."""
        return Links(*self._after(k)) if self.reach(k) else None

    def reach(self, k: int) -> bool:
        """Read on for `BUDGET_S` at most; whether the journal is read up to tick k."""
        until = self._now() + BUDGET_S
        while len(self._rows) <= k:
            if not self._read() or self._now() > until:
                break
        return len(self._rows) > k

    def _after(self, k: int) -> _Counts:
        """Sent, delivered and last heard after tick k."""
        number = k // _APART
        sent, delivered, heard = self._counts[number]
        first = number * _APART
        rows = self._rows[first : k + 1]
        shape = (len(rows), self._side, self._side)
        came, lost = (
            np.unpackbits(np.stack(bits), axis=1, count=self._side**2).reshape(shape).astype(np.bool_)
            for bits in zip(*rows, strict=True)
        )
        last = np.where(came.any(axis=0), first + len(rows) - 1 - came[::-1].argmax(axis=0), heard)
        arrived = came.sum(axis=0)
        return sent + arrived + lost.sum(axis=0), delivered + arrived, last

    def _read(self) -> bool:
        """One tick more of the journal; False where it ends."""
        record = next(self._records, None)
        if record is None:
            return False
        place, side = self._run.index, self._side
        came, lost = np.zeros(side * side, dtype=np.uint8), np.zeros(side * side, dtype=np.uint8)
        links = [(source, to, came) for source, to, _ in record.deliveries]
        links += [(source, to, lost) for source, to, _, _ in record.dropped]
        for source, to, bits in links:
            if source in place and to in place:
                bits[place[source] * side + place[to]] = 1
        self._rows.append((np.packbits(came), np.packbits(lost)))
        if len(self._rows) % _APART == 0:
            self._counts.append(self._after(len(self._rows) - 1))
        return True
