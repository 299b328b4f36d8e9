"""A map of last-seen ticks, kept for later in a small part of its bytes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A map as runs of equal values: where another value begins, row by row, and which; both int32 (n,)."""

    shape: tuple[int, ...]
    begins: NDArray[np.int32]
    values: NDArray[np.int32]

    @classmethod
    def of(cls, seen: NDArray[np.int32]) -> Snapshot:
        """seen: int32 (h, w), of at least one point."""
        flat = seen.ravel()
        begins = np.concatenate(([0], np.flatnonzero(flat[1:] != flat[:-1]) + 1)).astype(np.int32)
        return cls(seen.shape, begins, flat[begins])

    @property
    def nbytes(self) -> int:
        """What it takes."""
        return self.begins.nbytes + self.values.nbytes

    def map(self) -> NDArray[np.int32]:
        """int32 (h, w), a new one."""
        points = int(np.prod(self.shape))
        return np.repeat(self.values, np.diff(self.begins, append=points)).reshape(self.shape)
