"""Kernel of first steps: the one of eight with which a path of the wave begins, where equally long paths differ in it.

A wave (`agent.kernels.wave`) gives the lengths. A point's *predecessors* are the neighbours from which a step
leads to it on a shortest path. Each point takes one of them, and the first step of the path there; what is taken
decides where paths begin. On open ground, 5 points across and 3 up from the start, a shortest path has 3 diagonal steps
and 2 straight ones in any order:

    last step diagonal wherever possible     straight steps come first: it begins to the right
    last step drawn for each point           whichever kind lasts longer comes first, mostly the diagonal one here
"""

from __future__ import annotations

from numba import njit, types

STATUS = 3
SETTLED = 3
STATE = types.Array(types.uint8, 2, "C", readonly=True)
LENGTHS = types.Array(types.int32, 2, "C", readonly=True)
NUMBERS = types.Array(types.int32, 2, "C")
int64 = types.int64
uint64 = types.uint64
index = types.uint64
"""Unsigned, so that numba skips the negative-index check."""


@njit(types.uint64(types.uint64, types.uint64), cache=True, nogil=True)
def _mixed(state, value):
    """Return the next state of the hash; see `patrol.random`."""
    z = (state ^ value) + uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> uint64(30))) * uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> uint64(27))) * uint64(0x94D049BB133111EB)
    return z ^ (z >> uint64(31))


# fmt: off
@njit(
    types.void(STATE, LENGTHS, NUMBERS, int64, int64, int64, int64, types.boolean, types.uint64,
               int64, int64, int64, int64),
    cache=True,
    nogil=True,
)
def begin_paths(state, length, bend, start_row, start_col, row0, col0, drawn, key, top, bottom, left, right):
    """Replace the first bends of the settled points of a box by the points to which their first steps lead.

    Args:
        state: uint8 (m, n), as the wave left it; the outermost points are blocked.
        length: int32 (m, n), path lengths in hundredths of a point, where they are settled.
        bend: int32 (m, n), overwritten where a path is settled: flat index of the start's neighbour on the path, or of
            the start itself.
        start_row: Row of the start.
        start_col: Its column.
        row0: Row of the terrain's point under row 0.
        col0: Column of the terrain's point under column 0.
        drawn: Draw the predecessor of each point; otherwise take a diagonal step's, where there is one.
        key: Of the draws.
        top: First row of the box of all settled points.
        bottom: End row, exclusive.
        left: First column.
        right: End column, exclusive.
    """
    stride = state.shape[1]
    start = start_row * stride + start_col
    status, lengths, steps = state.reshape(-1), length.reshape(-1), bend.reshape(-1)
    # The diagonal ones first.
    step = (stride + 1, stride - 1, -stride - 1, -stride + 1, 1, stride, -1, -stride)
    for row in range(top, bottom):
        row_key = _mixed(key, uint64(row0 + row))
        for col in range(left, right):
            here = row * stride + col
            if status[index(here)] & STATUS != SETTLED or here == start:
                continue
            # The predecessors, four bits each: their places in the order of the steps.
            count, ways, far = 0, 0, lengths[index(here)]
            for way in range(8):
                before = here - step[way]
                cost = 141 if way < 4 else 100
                if lengths[index(before)] + cost != far or status[index(before)] & STATUS != SETTLED:
                    continue
                if way < 4:
                    along, above = 1 if way % 3 == 0 else -1, stride if way < 2 else -stride
                    if status[index(here - along)] == 0 or status[index(here - above)] == 0:
                        continue
                ways |= way << 4 * count
                count += 1
            taken = 0
            if drawn and count > 1:
                # The upper half of the hash, scaled: a division would take longer than all the rest.
                taken = int64((_mixed(row_key, uint64(col0 + col)) >> uint64(32)) * uint64(count) >> uint64(32))
            before = here - step[ways >> 4 * taken & 15]
            # A point next to the start is a first step. Any other has that of its predecessor, which is noted so.
            steps[index(here)] = here if before == start else -1 - before
    steps[index(start)] = start
    for row in range(top, bottom):
        for col in range(left, right):
            here = row * stride + col
            if status[index(here)] & STATUS != SETTLED:
                continue
            back = int64(steps[index(here)])
            while back < 0:
                back = int64(steps[index(-1 - back)])
            while steps[index(here)] < 0:
                before = -1 - int64(steps[index(here)])
                steps[index(here)] = back
                here = before
# fmt: on
