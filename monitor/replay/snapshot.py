"""A compressed map of last-seen ticks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A map as runs of equal values, row by row."""

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
