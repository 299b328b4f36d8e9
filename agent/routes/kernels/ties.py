"""Kernel of ties: which of several equally long paths to a point counts, and so where it first bends.

Of two paths that end with the same kind of step, straight or diagonal, the one counts whose point before the end comes
first. Of two points with equally long paths, the one comes first whose own path ends diagonally; then the one whose
point before the end comes first, and so on back to where the paths part. There, rows and columns come in the order of
`agent.routes.kernels.wave`'s directions.
"""

from __future__ import annotations

import numpy as np
from numba import njit, types

BESIDE = 1
FULL = 4
TIES = 2
"""As in `agent.routes.kernels.wave`."""

CELLS = types.Array(types.uint32, 1, "C")
LISTS = types.Array(types.uint32, 2, "C")
MARK = types.Array(types.int64, 1, "C")
STEPS = types.Array(types.int64, 1, "C")
int64 = types.int64
index = types.uint64
"""As in `agent.routes.kernels.wave`."""


@njit(types.boolean(int64, int64), cache=True, nogil=True)
def _goes_on(cell, way):
    """Whether the path to a point is tried on in a direction."""
    came = cell >> 2 & 7
    if cell & BESIDE != 0 or way == came:
        return True
    side_a = 4 if came % 3 == 0 else 6
    side_b = 5 if came < 2 else 7
    return came < 4 and way in (side_a, side_b)


@njit(types.boolean(CELLS, STEPS, int64, int64, int64), cache=True, nogil=True)
def _may(cell, step, here, way, known):
    """Whether the path to a point is tried on in a direction that cuts no corner."""
    if not _goes_on(known, way):
        return False
    if way > 3 or known & BESIDE == 0:
        return True
    side_a = step[4] if way % 3 == 0 else step[6]
    side_b = step[5] if way < 2 else step[7]
    return cell[index(here + side_a)] != 0 and cell[index(here + side_b)] != 0


@njit(types.boolean(CELLS, STEPS, int64, int64), cache=True, nogil=True)
def _first(cell, step, one, other):
    """Whether one point comes before another one with an equally long path."""
    while True:
        came, met = cell[index(one)] >> 2 & 7, cell[index(other)] >> 2 & 7
        if (came < 4) != (met < 4):
            return came < 4
        one -= step[came]
        other -= step[met]
        if one == other:
            known = cell[index(one)]
            # A path that came in direction 1 turns into direction 6 before it turns into 5.
            return (came < met) != (known & BESIDE == 0 and known >> 2 & 7 == 1)


@njit(types.int64(int64[::1], int64, int64), cache=True, nogil=True)
def _push(heap, size, entry):
    """Add to a heap; returns its new size."""
    at = size
    while at > 0 and heap[(at - 1) >> 1] > entry:
        heap[at] = heap[(at - 1) >> 1]
        at = (at - 1) >> 1
    heap[at] = entry
    return size + 1


@njit(types.int64(int64[::1], int64), cache=True, nogil=True)
def _pop(heap, size):
    """Take the least entry, which is the first, out of a heap; returns its new size."""
    size -= 1
    last, at = heap[size], 0
    while 2 * at + 1 < size:
        below = 2 * at + 1
        if below + 1 < size and heap[below + 1] < heap[below]:
            below += 1
        if heap[below] >= last:
            break
        heap[at] = heap[below]
        at = below
    heap[at] = last
    return size


@njit(types.int64(CELLS, LISTS, MARK, int64, int64), cache=True, nogil=True)
def decide(cell, lists, mark, stride, limit):
    """Decide all ties among the paths that `agent.routes.kernels.wave.settle` has settled up to ``limit``.

    Points are taken nearest first, so that all that comes before a point is decided. Where another path counts from
    now on, the points behind are looked at again.

    Args:
        cell: uint32, as `settle` left it; changed in place.
        lists: uint32 (5, k), likewise; the points beyond ``limit`` stay in it.
        mark: int64 (8,), likewise.
        stride: Columns of the window.
        limit: As for `settle`.

    Returns:
        The number of points that were looked at.
    """
    step = np.array([stride + 1, stride - 1, -stride - 1, -stride + 1, 1, stride, -1, -stride])
    heap = np.empty(256, dtype=np.int64)
    size, count, looked, last = 0, mark[TIES], 0, int64(-1)
    mark[TIES] = 0
    for k in range(count):
        there = lists[2, k]
        far = int64(cell[there] >> 5)
        if far > limit:
            lists[2, mark[TIES]] = there
            mark[TIES] += 1
            continue
        if size + 8 > heap.size:
            heap = np.concatenate((heap, np.empty_like(heap)))
        size = _push(heap, size, far << 32 | int64(there))
    while size > 0:
        entry = heap[0]
        size = _pop(heap, size)
        if entry == last:
            continue
        last = entry
        looked += 1
        here, far = entry & 0xFFFFFFFF, entry >> 32
        best, before = -1, int64(0)
        for way in range(8):
            if way == 4 and best >= 0:
                break
            point = here - step[way]
            known = int64(cell[index(point)])
            cost = 141 if way < 4 else 100
            if known == 0 or (known >> 5) + cost != far or not _may(cell, step, point, way, known):
                continue
            if best < 0 or _first(cell, step, point, before):
                best, before = way, point
        if best < 0:
            continue  # A tie of a path that was improved on since.
        known = int64(cell[index(here)])
        if known >> 2 & 7 == best:
            continue
        decided = far << 5 | best << 2 | known & 3
        cell[index(here)] = decided
        if size + 8 > heap.size:
            heap = np.concatenate((heap, np.empty_like(heap)))
        for way in range(8):
            there = here + step[way]
            beyond = int64(cell[index(there)])
            away = far + (141 if way < 4 else 100)
            if beyond == 0 or beyond >> 5 != away:
                continue
            if beyond >> 2 & 7 != way and not _may(cell, step, here, way, decided):
                continue
            if away <= limit:
                size = _push(heap, size, away << 32 | there)
            elif mark[TIES] < lists.shape[1]:
                lists[2, mark[TIES]] = there
                mark[TIES] += 1
            else:
                mark[FULL] = 1
    return looked
