"""Kernel of the tour: a short closed tour through places."""

from __future__ import annotations

from numba import njit, types

KNOWN_LENGTHS = types.Array(types.int32, 2, "C", readonly=True)
TOUR = types.Array(types.int64, 1, "C")


@njit(types.int64(KNOWN_LENGTHS, TOUR), cache=True, nogil=True)
def shorten(lengths, tour):
    """Improve a closed tour in place until no move of 2-opt or Or-opt shortens it.

    For example, a tour over a square's corners (0, 0), (1, 1), (1, 0), (0, 1) in this order, along the axes, becomes
    0, 2, 1, 3, with a length of 4 sides.

    2-opt (Croes 1958) reverses a part of the tour; Or-opt (Or 1976) moves one to three consecutive places to another
    edge, in either direction. Each pass makes every move that shortens the tour as soon as it is found.

    Args:
        lengths: int32 (n, n), symmetric.
        tour: int64 (n,), a permutation of 0 to n - 1; changed in place.

    Returns:
        The length of the tour.
    """
    n = tour.size
    better = n > 3
    moved = tour[:3].copy()
    while better:
        better = False
        for i in range(n - 2):
            # The edge from the last place back to the first borders on the one from place 0, so it is no partner for
            # it.
            for j in range(i + 2, n - (i == 0)):
                a, b, c, d = tour[i], tour[i + 1], tour[j], tour[(j + 1) % n]
                if lengths[a, c] + lengths[b, d] < lengths[a, b] + lengths[c, d]:
                    low, high = i + 1, j
                    while low < high:
                        tour[low], tour[high] = tour[high], tour[low]
                        low += 1
                        high -= 1
                    better = True
        for size in range(1, min(4, n - 2)):
            for i in range(n):
                before, after = tour[(i - 1) % n], tour[(i + size) % n]
                first, last = tour[i], tour[(i + size - 1) % n]
                gain = lengths[before, first] + lengths[last, after] - lengths[before, after]
                # 0, so that a move that keeps the length is none: the loop would not end.
                best, position, turned = 0, -1, False
                for k in range(size, n - 1):  # the edge from place i + k to the next
                    a, b = tour[(i + k) % n], tour[(i + k + 1) % n]
                    cut = gain + lengths[a, b]
                    if cut - lengths[a, first] - lengths[last, b] > best:
                        best, position, turned = cut - lengths[a, first] - lengths[last, b], k, False
                    if cut - lengths[a, last] - lengths[first, b] > best:
                        best, position, turned = cut - lengths[a, last] - lengths[first, b], k, True
                if position < 0:
                    continue
                for m in range(size):
                    moved[m] = tour[(i + m) % n]
                for m in range(size, position + 1):  # those between move back
                    tour[(i + m - size) % n] = tour[(i + m) % n]
                for m in range(size):
                    tour[(i + position + 1 - size + m) % n] = moved[size - 1 - m] if turned else moved[m]
                better = True
    total = 0
    for i in range(n):
        total += lengths[tour[(i - 1) % n], tour[i]]
    return total
