"""Kernel of similar moments: how many points are seen in one of two moments alone."""

from __future__ import annotations

import numpy as np
from numba import njit, types

WORDS = types.Array(types.uint64, 2, "C", readonly=True)
DIFFERENCES = types.Array(types.int32, 1, "C")


@njit(types.void(WORDS, types.int64, types.int64, types.int64, DIFFERENCES), cache=True, nogil=True)
def differences(words, now, first, last, out):
    """Count the bits in which each of some rows differs from one row.

    Args:
        words: uint64 (rows, words).
        now: Number of the one row.
        first: Number of the first of the others.
        last: Number after the last of the others.
        out: int32 (last - first,), to which the counts are added.
    """
    low, pairs, nibbles = np.uint64(0x5555555555555555), np.uint64(0x3333333333333333), np.uint64(0x0F0F0F0F0F0F0F0F)
    ones, one, two, four, top = (
        np.uint64(0x0101010101010101),
        np.uint64(1),
        np.uint64(2),
        np.uint64(4),
        np.uint64(56),
    )
    for row in range(first, last):
        count = np.int64(0)
        for w in range(words.shape[1]):
            x = words[row, w] ^ words[now, w]
            x -= (x >> one) & low
            x = (x & pairs) + ((x >> two) & pairs)
            x = (x + (x >> four)) & nibbles
            count += np.int64((x * ones) >> top)
        out[row - first] += count
