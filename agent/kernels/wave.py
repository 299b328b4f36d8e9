"""Kernel of the wave: path lengths from one point, or several, to all others, and how paths begin (paper, "The wave").

Steps go to the eight neighbours and cost 100 along a row or column and 141 along a diagonal, so that equal lengths are
equal integers; a diagonal step needs both points beside it. Points are settled nearest first. Two queues hold the steps
that lead on, one the straight and one the diagonal ones: all steps of a queue cost the same, so the last entry is
farthest away, and the nearest is at one of the two ends.

Of equally long paths to a point, one whose last step is diagonal counts, and then the one that was found first.

Only neighbours that can lie on a new shortest path are tried: where all eight neighbours are open, a path that came
straight goes on straight, and one that came diagonally goes on diagonally or turns into either of its components.
Next to an obstacle all eight are tried. Lengths stay exact.

On the way to one goal, points that lie too far off are passed over: those whose length, and from there the least
length to the goal, together exceed the limit. That least length, the one without obstacles, changes by no more than a
step from point to point, so no shortest path within the limit leads over such a point.

A path's first bend is its last point that is in sight of the start and no farther than without obstacles; of the path
to such a point, it is the point itself.

In place of first bends the wave finds first steps. A point's *predecessors* are the neighbours from which a step leads
to it on a shortest path. Each point takes one of them, and the first step of the path there; what is taken decides
where paths begin. On open ground, 5 points across and 3 up from the start, a shortest path has 3 diagonal steps and 2
straight ones in any order:

    last step diagonal wherever possible     straight steps come first: it begins to the right
    last step drawn for each point           whichever kind lasts longer comes first, mostly the diagonal one here
"""

from __future__ import annotations

import numpy as np
from numba import njit, types

BLOCKED = 0
OPEN = 1
SETTLED = 3
STATUS = 3
HEMMED = 4
"""A point's state: its status in the two low bits, and HEMMED when one of its eight neighbours is blocked."""

FAR = 2**31 - 1
"""The length shown where no path is settled."""

NOWHERE = 8
"""In place of a direction: the start's. Directions 0 to 3 are diagonal, 4 to 7 straight."""

EMPTY = 2**63
"""In place of an entry: the end of a queue."""

FIRST_BENDS, DIAGONAL_LAST, DRAWN = 0, 1, 2
"""Results besides lengths: first bends, or first steps by the predecessor of a diagonal step, or by a draw."""

ROOM = 2**12
"""Entries for which the queues of a new wave have room, a power of two; it makes more as needed."""

GRID = types.Array(types.uint8, 2, "C", readonly=True)
STATE = types.Array(types.uint8, 2, "C")
NUMBERS = types.Array(types.int32, 2, "C")
QUEUES = types.Array(types.uint64, 2, "C")
FLAT = types.Array(types.uint8, 1, "C")
FLAT_NUMBERS = types.Array(types.int32, 1, "C")
QUEUE = types.Array(types.uint64, 1, "C")
STARTS = types.Array(types.int64, 1, "C", readonly=True)
FOUND = types.UniTuple(NUMBERS, 2)  # type: ignore[no-untyped-call]
int64 = types.int64
uint64 = types.uint64
index = types.uint64
"""Unsigned, so that numba skips the negative-index check."""


@njit(
    types.void(types.Array(types.boolean, 2, "C"), STATE, types.Array(types.int64, 2, "C", readonly=True)),
    cache=True,
    nogil=True,
)
def encode(is_open, state, boxes):
    """Bring the encoding up to date in some boxes and one point around each.

    Args:
        is_open: bool (m, n), framed by one closed point on every side.
        state: uint8 (m, n), changed in place: see HEMMED; its frame stays blocked.
        boxes: int64 (b, 4), first row, end row, first column and end column; ends are exclusive.
    """
    for top, bottom, left, right in boxes:
        for row in range(max(top - 1, 1), min(bottom + 1, state.shape[0] - 1)):
            for col in range(max(left - 1, 1), min(right + 1, state.shape[1] - 1)):
                if not is_open[row, col]:
                    state[row, col] = BLOCKED
                    continue
                surrounded = True
                for up in range(row - 1, row + 2):
                    surrounded &= is_open[up, col - 1] and is_open[up, col] and is_open[up, col + 1]
                state[row, col] = OPEN if surrounded else OPEN | HEMMED


@njit(int64(FLAT, FLAT_NUMBERS, QUEUE, int64, int64, int64, int64, int64), cache=True, nogil=True)
def _put(status, lengths, queue, end, there, way, away, limit):
    """Put a step into a queue if it leads to a point sooner than all others so far; returns the queue's new end."""
    if status[index(there)] == BLOCKED or away >= lengths[index(there)] or away > limit:
        return end
    lengths[index(there)] = away
    # The queue is a ring whose size is a power of two, so that `&` wraps the index.
    queue[index(end) & uint64(queue.size - 1)] = away << 32 | there << 4 | way
    return end + 1


@njit(types.uint64(types.uint64, types.uint64), cache=True, nogil=True)
def _mixed(state, value):
    """Return the next state of the hash; see `patrol.random`."""
    z = (state ^ value) + uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> uint64(30))) * uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> uint64(27))) * uint64(0x94D049BB133111EB)
    return z ^ (z >> uint64(31))


@njit(int64(FLAT, FLAT_NUMBERS, int64, int64, int64, uint64), cache=True, nogil=True)
def _predecessor(status, lengths, here, stride, found, draw):
    """Return the predecessor that a point takes: one of a diagonal step where there is one, or that of a draw."""
    step = (stride + 1, stride - 1, -stride - 1, -stride + 1, 1, stride, -1, -stride)
    count, ways, far = 0, 0, lengths[index(here)]  # four bits each: their places in the order of the steps
    for way in range(8):
        before = here - step[way]
        if lengths[index(before)] + (141 if way < 4 else 100) != far or status[index(before)] & STATUS != SETTLED:
            continue
        if way < 4:
            along, above = 1 if way % 3 == 0 else -1, stride if way < 2 else -stride
            if status[index(here - along)] == BLOCKED or status[index(here - above)] == BLOCKED:
                continue
        ways |= way << 4 * count
        count += 1
    # The upper half of the hash, scaled: a division would take longer than all the rest.
    pick = int64((draw >> uint64(32)) * uint64(count) >> uint64(32)) if found == DRAWN else 0
    return here - step[ways >> 4 * pick & 15]


# fmt: off
@njit(
    types.boolean(
        STATE, GRID, NUMBERS, NUMBERS, QUEUES, STARTS, int64, int64, int64, int64, int64, int64, uint64, int64, int64,
        int64,
    ),
    cache=True,
    nogil=True,
)
def settle(state, sight, length, bend, queues, starts, limit, top, bottom, left, right, found, key, row0, col0, goal):
    """Settle every point whose path is at most ``limit`` long.

    Args:
        state: uint8 (m, n), see HEMMED; the outermost points are blocked. SETTLED is set in the box where a path is
            found, and OPEN at all its other open points.
        sight: uint8 (m, n), 1 where the straight line from the start is free; for first bends.
        length: int32 (m, n), overwritten in the box: path lengths in hundredths of a point, FAR where none is settled.
        bend: int32 (m, n), filled in where a path is settled: flat index of its first bend, or of the start's neighbour
            on it; of size 0 for lengths alone.
        queues: uint64 (2, k), overwritten, k a power of two: length * 2^32 + index * 16 + direction of the last step.
        starts: int64 (s,), flat indices of the starts, which are open: one, or several for lengths alone.
        limit: Longest path to settle, in hundredths of a point; at most 2**26.
        top: First row of a box around all that is as near as the limit without obstacles.
        bottom: End row, exclusive.
        left: First column.
        right: End column, exclusive.
        found: FIRST_BENDS, DIAGONAL_LAST or DRAWN.
        key: Of the draws.
        row0: Row of the terrain's point under row 0, for draws.
        col0: Column of the terrain's point under column 0.
        goal: Flat index of the only point whose path is asked for, or -1. Points from which no path to it can be within
            the limit are passed over, and nothing is settled after it. What is settled on a shortest path to it is the
            same as without a goal.

    Returns:
        Whether there was room enough in ``queues``; if not, nothing that was written has any meaning.
    """
    for row in range(top, bottom):
        flags, unknown = state[row, left:right], length[row, left:right]
        for k in range(right - left):
            # SETTLED contains the bit of OPEN, so the mask clears the rest of it and leaves OPEN.
            flags[k] &= OPEN | HEMMED
            unknown[k] = FAR
    stride = state.shape[1]
    step = (stride + 1, stride - 1, -stride - 1, -stride + 1, 1, stride, -1, -stride)
    status, in_sight, lengths, bends = state.reshape(-1), sight.reshape(-1), length.reshape(-1), bend.reshape(-1)
    diagonal, straight = queues[0], queues[1]
    # Ten less: one point adds at most four steps to a queue, and so room is checked once for each point.
    turn, room = uint64(queues.shape[1] - 1), queues.shape[1] - 10
    next_diagonal, end_diagonal, next_straight, end_straight = 0, 0, 0, starts.size
    start_row, start_col, goal_row, goal_col = 0, 0, goal // stride, goal % stride
    needs_row = goal >= 0 or bends.size != 0
    for place in range(min(starts.size, room)):
        start = starts[place]
        lengths[index(start)] = 0
        straight[place] = start << 4 | NOWHERE
        start_row, start_col = start // stride, start % stride
    while end_diagonal - next_diagonal < room and end_straight - next_straight < room:
        # The end of each queue reads as the greatest length, so that an empty queue needs no check of its own.
        diagonal[index(end_diagonal) & turn] = straight[index(end_straight) & turn] = EMPTY
        entry, straight_entry = diagonal[index(next_diagonal) & turn], straight[index(next_straight) & turn]
        # At equal lengths the diagonal step comes first: it is the last step that counts.
        if entry >> uint64(32) <= straight_entry >> uint64(32):
            if entry == EMPTY:
                return True
            next_diagonal += 1
        else:
            entry = straight_entry
            next_straight += 1
        far, came = int64(entry >> uint64(32)), int64(entry & uint64(15))
        here = int64(entry >> uint64(4) & uint64(2**28 - 1))
        flags = status[index(here)]
        # An older entry: a shorter path has reached the point since.
        if flags & STATUS == SETTLED:
            continue
        row = int64(index(here) // index(stride)) if needs_row else 0
        if goal >= 0:
            up, across = abs(row - goal_row), abs(here - row * stride - goal_col)
            if far + 100 * max(up, across) + 41 * min(up, across) > limit:
                continue
        status[index(here)] = flags | SETTLED
        if bends.size != 0:
            before, is_bend = here, came == NOWHERE
            if not is_bend:
                before = here - step[came]
                if found != FIRST_BENDS:
                    draw = _mixed(_mixed(key, uint64(row0 + row)), uint64(col0 + here - row * stride))
                    before = _predecessor(status, lengths, here, stride, found, draw)
                    is_bend = lengths[index(before)] == 0
                elif in_sight[index(here)] != 0:
                    up, across = abs(row - start_row), abs(here - row * stride - start_col)
                    is_bend = far == 100 * max(up, across) + 41 * min(up, across)
            bends[index(here)] = here if is_bend else bends[index(before)]
        if here == goal:
            return True
        on, aslant = far + 100, far + 141
        if came == NOWHERE or flags & HEMMED != 0:
            for way in range(4):
                along, above = 1 if way % 3 == 0 else -1, stride if way < 2 else -stride
                if status[index(here + along)] != BLOCKED and status[index(here + above)] != BLOCKED:
                    ahead = here + step[way]
                    end_diagonal = _put(status, lengths, diagonal, end_diagonal, ahead, way, aslant, limit)
            for way in range(4, 8):
                end_straight = _put(status, lengths, straight, end_straight, here + step[way], way, on, limit)
        elif came > 3:
            end_straight = _put(status, lengths, straight, end_straight, here + step[came], came, on, limit)
        else:
            along, above = 1 if came % 3 == 0 else -1, stride if came < 2 else -stride
            way = 4 if came % 3 == 0 else 6
            end_straight = _put(status, lengths, straight, end_straight, here + along, way, on, limit)
            way = 5 if came < 2 else 7
            end_straight = _put(status, lengths, straight, end_straight, here + above, way, on, limit)
            end_diagonal = _put(status, lengths, diagonal, end_diagonal, here + step[came], came, aslant, limit)
    return False


# fmt: on


@njit(STATE(GRID, int64, int64, int64, int64), cache=True, nogil=True)
def framed_box(state, top, bottom, left, right):
    """Copy a box of a ground, and frame it by one blocked point on every side.

    Args:
        state: uint8 (h + 2, w + 2), `agent.routes.ground.Ground.state`.
        top: First row of the terrain.
        bottom: End row, exclusive.
        left: First column.
        right: End column, exclusive.

    Returns:
        uint8 (bottom - top + 2, right - left + 2).
    """
    height, width = bottom - top, right - left
    box = np.zeros((height + 2, width + 2), dtype=np.uint8)
    box[1 : height + 1, 1 : width + 1] = state[top + 1 : bottom + 1, left + 1 : right + 1]
    return box


@njit(FOUND(STATE, GRID, types.Array(int64, 2, "A", readonly=True), int64, int64), cache=True, nogil=True)
def settle_box(state, sight, starts, limit, goal):
    """Settle every point of a box whose path from the nearest of some starts is at most `limit` long.

    Args:
        state: uint8 (m, n), as of `settle`.
        sight: uint8 (m, n), as of `settle`; (0, 0) for lengths alone.
        starts: int64 (s, 2), rows and columns in `state`; those that are not in the box are passed over.
        limit: As of `settle`.
        goal: As of `settle`.

    Returns:
        `length` and `bend` of `settle`; `bend` is (0, 0) for lengths alone.
    """
    rows, cols = state.shape
    length = np.empty((rows, cols), dtype=np.int32)
    bend = np.empty(sight.shape, dtype=np.int32)
    inside, count = np.empty(starts.shape[0], dtype=np.int64), 0
    for start in range(starts.shape[0]):
        row, col = starts[start]
        if 0 < row < rows - 1 and 0 < col < cols - 1:
            inside[count] = row * cols + col
            count += 1
    queues = np.empty((2, ROOM), dtype=np.uint64)
    key, box = uint64(0), (0, rows, 0, cols)
    while not settle(state, sight, length, bend, queues, inside[:count], limit, *box, FIRST_BENDS, key, 0, 0, goal):
        queues = np.empty((2, 4 * queues.shape[1]), dtype=np.uint64)
    return length, bend
