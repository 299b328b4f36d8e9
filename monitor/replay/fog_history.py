"""A fog at any tick of a run: it goes on from the nearest snapshot before, of which some are kept on the way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from patrol.ground.fog import Fog

MOST_SNAPSHOTS = 400


class FogHistory:
    """Gives a fog at any tick, forwards and backwards."""

    def __init__(self, blank: Callable[[], Fog], advance: Callable[[Fog, int], Fog], ticks: int, memory: int) -> None:
        """Start before the first tick.

        `blank` makes the fog as it is then, and `advance` takes the fog of the tick before and returns that of a tick.
        Snapshots are evenly spread over the run's `ticks`; about `memory` is for them, in bytes.
        """
        self._blank = blank
        self._advance = advance
        self._memory = memory
        self._apart = max(1, ticks // MOST_SNAPSHOTS)
        self._kept: dict[int, Snapshot] = {}
        self._fog, self._k = blank(), -1

    @property
    def held(self) -> int:
        """Size of the snapshots, bytes."""
        return sum(snapshot.nbytes for snapshot in self._kept.values())

    def base(self, k: int) -> int:
        """Return the last tick up to k from which the fog can go on without being made anew; -1 for none."""
        if self._k in (k - 1, k):  # as it is while a run is played
            return self._k
        return max(tick for tick in (-1, self._k, *self._kept) if tick <= k)

    def place(self, k: int) -> int:
        """Return the last tick up to k that has a place for a snapshot.

        For example, 20 for tick 27 with snapshots 10 ticks apart.
        """
        return k - k % self._apart

    def fog(self, k: int, over: Callable[[], bool] = lambda: False) -> Fog | None:
        """Return the fog after a tick, valid until the next call; None if `over` says meanwhile that time is up."""
        base = self.base(k)
        if base != self._k:
            fog, snapshot = self._blank(), self._kept.get(base)
            self._fog = fog if snapshot is None else Fog.resumed(fog.patrolled.view(np.bool_), snapshot.map())
            self._k = base
        while self._k < k:
            self._fog = self._advance(self._fog, self._k + 1)
            self._k += 1
            if self._k % self._apart == 0:
                self._keep_snapshot()
            if self._k < k and over():
                return None
        return self._fog

    def put(self, fog: Fog, k: int) -> None:
        """Take over the fog of a tick that was made in another way."""
        self._fog, self._k = fog, k
        self._keep_snapshot()

    def _keep_snapshot(self) -> None:
        """Keep a snapshot; where they take too much memory, from then on only every other one."""
        if self._k not in self._kept:
            self._kept[self._k] = Snapshot.of(self._fog.last_seen)
            if self.held > self._memory:
                self._apart *= 2
                self._kept = {k: snapshot for k, snapshot in self._kept.items() if k % self._apart == 0}


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A map of last-seen ticks as runs of equal values, row by row.

    For example, the rows (5, 5, 0) and (0, 0, 7) have three runs, which begin at 0, 2 and 5, with the values 5, 0 and
    7.
    """

    shape: tuple[int, ...]
    begins: NDArray[np.int32]  # (n,), flat index of each run's first point
    values: NDArray[np.int32]  # (n,), value of each run

    @classmethod
    def of(cls, seen: NDArray[np.int32]) -> Snapshot:
        """Compress a map, int32 (h, w), of at least one point."""
        flat = seen.ravel()
        begins = np.concatenate(([0], np.flatnonzero(flat[1:] != flat[:-1]) + 1)).astype(np.int32)
        return cls(seen.shape, begins, flat[begins])

    @property
    def nbytes(self) -> int:
        """Its size in bytes."""
        return self.begins.nbytes + self.values.nbytes

    def map(self) -> NDArray[np.int32]:
        """Return the map as a new int32 (h, w) array."""
        points = int(np.prod(self.shape))
        return np.repeat(self.values, np.diff(self.begins, append=points)).reshape(self.shape)
