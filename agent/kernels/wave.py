"""Kernel of the wave: path lengths from one point, or several, to all others, and how paths begin (paper, "The wave").

Steps go to the eight neighbours and cost 100 along a row or column and 141 along a diagonal, so that equal lengths are
equal integers; a diagonal step needs both points beside it. Points are settled in rounds, each of lengths of 100, so
that a step never ends in the round in which it begins, and in a round the order does not count.

Of equally long paths to a point, one whose last step is diagonal counts, and then the one that is found first where
points are settled nearest first and go on in the order of the directions, or along the row first where they go on to
both sides. Which of two that is shows where they part, so both are followed back to there.

While the wave runs, a point's cell holds length * 32 + direction of the last step * 4 + IN_SIGHT + BESIDE, so that
cells without their four low bits compare as paths do. Directions 0 to 3 are diagonal, 4 to 7 straight. For example,
3218, which is 100 * 32 + 4 * 4 + IN_SIGHT, is a point in sight whose path has the length 100 and came along its row. A
blocked point's cell is 0.

Only neighbours that can lie on a new shortest path are tried: where all eight neighbours are open, a path that came
straight goes on straight, and one that came diagonally goes on diagonally or turns into either of its components.
Next to an obstacle all eight are tried. Lengths stay exact.

On the way to one goal, points that lie too far off are passed over: those whose length, and from there the least
length to the goal, together exceed the limit. That least length, the one without obstacles, changes by no more than a
step from point to point, so no shortest path within the limit leads over such a point.

A path's first bend is its last point that is in sight of the start and no farther than without obstacles; of the path
to such a point, it is the point itself. With first bends, the open ground around the start is settled at once
(`_settle_clear`), and the rounds only go on from its border.

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

BESIDE, IN_SIGHT = 1, 2
"""In a cell: next to a blocked point, or the start itself; in sight of the start."""

UNKNOWN = (2**27 - 1) << 5
"""The cell of a point without a path."""

FIRST_BENDS, DIAGONAL_LAST, DRAWN = 0, 1, 2
"""Results besides lengths: first bends, or first steps by the predecessor of a diagonal step, or by a draw."""

ROOM = 2**12
"""Steps of a round for which a new wave has room; it makes more as needed."""

GRID = types.Array(types.uint8, 2, "C", readonly=True)
STATE = types.Array(types.uint8, 2, "C")
NUMBERS = types.Array(types.int32, 2, "C")
CELLS = types.Array(types.uint32, 1, "C")
PLACES = types.Array(types.int32, 1, "C")
STARTS = types.Array(types.int64, 1, "C", readonly=True)
FOUND = types.UniTuple(NUMBERS, 2)  # type: ignore[no-untyped-call]
int64 = types.int64
uint32 = types.uint32
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
                    # The frame is closed, so points along the edge are hemmed as well and no index lies outside.
                    surrounded &= is_open[up, col - 1] and is_open[up, col] and is_open[up, col + 1]
                state[row, col] = OPEN if surrounded else OPEN | HEMMED


@njit(int64(int64, int64), cache=True, nogil=True, forceinline=True)
def _step(way, stride):
    """Return the step of a direction: what it adds to a flat index.

    For example, direction 0 leads to the next row and the next column, so with rows of 10 points it adds 11.
    """
    # Rows and columns of all directions, two bits each and one more than they are: far faster than a tuple of steps.
    return ((0x190A >> 2 * way & 3) - 1) * stride + (0x4682 >> 2 * way & 3) - 1


@njit(int64(int64, int64, int64, int64), cache=True, nogil=True, forceinline=True)
def _least_length(here, row, col, stride):
    """Return the length of the path from a point to another one, (row, col), without obstacles.

    For example, 623 over 3 rows and 5 columns: three diagonal steps and two straight ones.
    """
    here_row = int64(index(here) // index(stride))
    up, across = abs(here_row - row), abs(here - here_row * stride - col)
    return 100 * max(up, across) + 41 * min(up, across)


@njit(types.boolean(CELLS, int64, int64, int64), cache=True, nogil=True)
def _is_first(cell, here, other, stride):
    """Return True if of two points with equally long paths the first one is settled first."""
    while True:
        way, other_way = int64(cell[index(here)]) >> 2 & 7, int64(cell[index(other)]) >> 2 & 7
        if way >> 2 != other_way >> 2:
            return way < other_way
        here -= _step(way, stride)
        other -= _step(other_way, stride)
        # Two starts are equally near.
        if here == other or cell[index(here)] >> uint32(5) == 0:
            return way < other_way if cell[index(here)] & BESIDE != 0 else way & 1 == 0


@njit(int64(CELLS, CELLS, int64, int64, int64, int64, int64, int64, int64), cache=True, nogil=True, forceinline=True)
def _put(cell, soon, count, here, there, away, way, limit, stride):
    """Put a step among those of the next round if its path is the one that counts; returns how many these are."""
    if away > limit:
        return count
    known, label = int64(cell[index(there)]), away << 5 | way << 2
    # The four low bits hold the lowest two of the direction and the marks, so this compares length and kind of step.
    if label >> 4 >= known >> 4:
        if label >> 4 != known >> 4 or known >> 2 == label >> 2:
            return count
        if not _is_first(cell, here, there - _step(known >> 2 & 7, stride), stride):
            return count
    cell[index(there)] = label | known & (BESIDE | IN_SIGHT)
    soon[index(count)] = there << 3 | way
    return count + 1


@njit(int64(CELLS, PLACES, int64, int64, int64, PLACES), cache=True, nogil=True)
def _settle_clear(cell, bends, start, stride, limit, seeds):
    """Settle the points in sight to which no path has to bend, far faster than in rounds.

    The eight directions cut the ground into octants. In an octant, a point is ``far`` straight steps from the start and
    ``line`` steps aside, so that ``line`` of its path's steps are diagonal. It is *clear* if it is in sight, not next
    to an obstacle, and clear are the points from which paths lead to it, (far - 1, line) and (far - 1, line - 1).

    Args:
        cell: As in `settle`, nothing settled; filled in at clear points.
        bends: First bends; filled in at clear points.
        start: Flat index of the start.
        stride: Length of a row.
        limit: As of `settle`.
        seeds: By round, all -1; set to one of the clear points from which paths lead on to others. The next one of the
            round is its entry of ``bends``.

    Returns:
        The number of seeds.
    """
    count, fresh = 0, uint32(UNKNOWN | IN_SIGHT)
    for octant in range(8):
        corner = octant >> 1
        straight = (5 if corner < 2 else 7) if octant & 1 else (4 if corner % 3 == 0 else 6)
        ahead, aside, last = _step(straight, stride), _step(corner, stride), limit
        for line in range(limit // 141 + 2):
            far = max(line, 1)
            here, away = start + line * aside + (far - line) * ahead, 100 * far + 41 * line
            while away <= limit and far <= last + 1:
                label = uint32(away << 5 | (corner if far == line else straight) << 2 | IN_SIGHT)
                if cell[index(here)] == fresh:
                    cell[index(here)], bends[index(here)] = label, here
                # Octants share points.
                # Another label than the one that this octant would give: the point is not clear.
                elif cell[index(here)] != label:
                    break
                here, far, away = here + ahead, far + 1, away + 100
            before = here - (ahead if far > line else aside)
            if before != start and bends[index(before)] == before:
                turn = int64(cell[index(before)]) // 3200
                bends[index(before)], seeds[turn] = seeds[turn], before
                count += 1
            if far == line:
                break
            last = far - 1
    return count


@njit(types.uint64(types.uint64, types.uint64), cache=True, nogil=True)
def _mixed(state, value):
    """Return the next state of the hash; see `patrol.random`."""
    z = (state ^ value) + uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> uint64(30))) * uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> uint64(27))) * uint64(0x94D049BB133111EB)
    return z ^ (z >> uint64(31))


@njit(int64(CELLS, int64, int64, int64, uint64), cache=True, nogil=True)
def _predecessor(cell, here, stride, found, draw):
    """Return the predecessor that a point takes: one of a diagonal step where there is one, or that of a draw."""
    count, ways, far = 0, 0, int64(cell[index(here)]) >> 5  # four bits each: their places in the order of the steps
    for way in range(8):
        before = here - _step(way, stride)
        known = int64(cell[index(before)])
        if known == BLOCKED or (known >> 5) + (141 if way < 4 else 100) != far:
            continue
        if way < 4:
            along, above = 1 if way % 3 == 0 else -1, stride if way < 2 else -stride
            if cell[index(here - along)] == BLOCKED or cell[index(here - above)] == BLOCKED:
                continue
        ways |= way << 4 * count
        count += 1
    # The upper half of the hash, scaled: a division would take longer than all the rest.
    pick = int64((draw >> uint64(32)) * uint64(count) >> uint64(32)) if found == DRAWN else 0
    return here - _step(ways >> 4 * pick & 15, stride)


# fmt: off
@njit(
    types.void(
        STATE, GRID, NUMBERS, NUMBERS, STARTS, int64, int64, int64, int64, int64, int64, uint64, int64, int64, int64,
    ),
    cache=True,
    nogil=True,
)
def settle(state, sight, length, bend, starts, limit, top, bottom, left, right, found, key, row0, col0, goal):
    """Settle every point whose path is at most ``limit`` long.

    Args:
        state: uint8 (m, n), see HEMMED; the outermost points are blocked. SETTLED is set in the box where a path is
            found, and OPEN at all its other open points.
        sight: uint8 (m, n), 1 where the straight line from the start is free; for first steps, of its neighbours alone.
        length: int32 (m, n), overwritten in the box: path lengths in hundredths of a point, FAR where none is settled.
        bend: int32 (m, n), set where a path is settled: the flat index of its first bend, or of the start's neighbour
            on it; of size 0 for lengths alone.
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
            the limit are passed over, and no round begins after its own. What is settled on a shortest path to it is
            the same as without a goal; other points may be shown as settled that are not.
    """
    stride = state.shape[1]
    cells = length.view(np.uint32)
    cell, bends = cells.reshape(-1), bend.reshape(-1)
    lists = np.empty((2, max(ROOM, starts.size)), dtype=np.uint32)
    now, soon, waiting, end = lists[0], lists[1], starts.size, 0
    start_row, start_col, goal_row, goal_col = 0, 0, goal // stride, goal % stride
    for place in range(waiting):
        start_row, start_col = starts[place] // stride, starts[place] % stride
        now[place] = starts[place] << 3
    for row in range(top, bottom):
        flags, line = state[row, left:right], cells[row, left:right]
        for k in range(right - left):
            line[k] = uint32(UNKNOWN) | uint32(flags[k] & HEMMED) >> uint32(2) if flags[k] & STATUS != BLOCKED else 0
        if bends.size != 0:
            seen = sight[row, left:right]
            for k in range(right - left):
                line[k] |= uint32(IN_SIGHT) if seen[k] != 0 and line[k] != 0 else uint32(0)
    for place in range(waiting):
        cell[index(starts[place])] = BESIDE | IN_SIGHT
    seeds, pending = np.empty(0, dtype=np.int32), 0
    if bends.size != 0 and found == FIRST_BENDS and goal < 0:
        seeds = np.full(min(limit, 141 * max(state.shape)) // 100 + 1, -1, dtype=np.int32)
        pending = _settle_clear(cell, bends, starts[0], stride, limit, seeds)
    while waiting + pending > 0:
        if 8 * (waiting + pending) > soon.size:
            lists = np.empty((2, 16 * (waiting + pending)), dtype=np.uint32)
            for place in range(waiting):
                lists[0, place] = now[place]
            now, soon = lists[0], lists[1]
        seed = int64(seeds[end // 100]) if pending > 0 else -1
        while seed >= 0:
            now[index(waiting)] = seed << 3 | int64(cell[index(seed)]) >> 2 & 7
            seed, waiting, pending = int64(bends[index(seed)]), waiting + 1, pending - 1
        end += 100
        count = 0
        for place in range(waiting):
            entry = int64(now[index(place)])
            here, came = entry >> 3, entry & 7
            known = int64(cell[index(here)])
            # An older entry: a path that counts more has reached the point since.
            # Entries are not removed when a better path comes; they are passed over here.
            if known >> 2 & 7 != came:
                continue
            far = known >> 5
            # It belongs to a later round and waits for it.
            if far >= end:
                soon[index(count)] = entry
                count += 1
                continue
            if goal >= 0 and far + _least_length(here, goal_row, goal_col, stride) > limit:
                continue
            if bends.size != 0:
                if known & IN_SIGHT != 0 and far == _least_length(here, start_row, start_col, stride):
                    bends[index(here)] = here
                elif found == FIRST_BENDS:
                    bends[index(here)] = bends[index(here - _step(came, stride))]
                else:
                    row = int64(index(here) // index(stride))
                    draw = _mixed(_mixed(key, uint64(row0 + row)), uint64(col0 + here - row * stride))
                    bends[index(here)] = bends[index(_predecessor(cell, here, stride, found, draw))]
            if here == goal:
                count = 0
                break
            if known & BESIDE != 0:
                for way in range(4):
                    along, above = 1 if way % 3 == 0 else -1, stride if way < 2 else -stride
                    if cell[index(here + along)] != BLOCKED and cell[index(here + above)] != BLOCKED:
                        ahead = here + along + above
                        count = _put(cell, soon, count, here, ahead, far + 141, way, limit, stride)
                for way in range(4, 8):
                    ahead = here + _step(way, stride)
                    count = _put(cell, soon, count, here, ahead, far + 100, way, limit, stride)
            elif came > 3:
                ahead = here + _step(came, stride)
                count = _put(cell, soon, count, here, ahead, far + 100, came, limit, stride)
            else:
                along, above = 1 if came % 3 == 0 else -1, stride if came < 2 else -stride
                way = 4 if came % 3 == 0 else 6
                count = _put(cell, soon, count, here, here + along, far + 100, way, limit, stride)
                way = 5 if came < 2 else 7
                count = _put(cell, soon, count, here, here + above, far + 100, way, limit, stride)
                count = _put(cell, soon, count, here, here + along + above, far + 141, came, limit, stride)
        now, soon, waiting = soon, now, count
    for row in range(top, bottom):
        flags, line, lengths = state[row, left:right], cells[row, left:right], length[row, left:right]
        for k in range(right - left):
            settled = line[k] != BLOCKED and line[k] < UNKNOWN
            # SETTLED contains the bit of OPEN.
            flags[k] = flags[k] & HEMMED | (SETTLED if settled else flags[k] & OPEN)
            lengths[k] = line[k] >> uint32(5) if settled else FAR


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
    for row in range(1, height + 1):
        copy, line = box[row, 1 : width + 1], state[top + row, left + 1 : right + 1]
        for k in range(width):
            copy[k] = line[k]
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
    settle(state, sight, length, bend, inside[:count], limit, 0, rows, 0, cols, FIRST_BENDS, uint64(0), 0, 0, goal)
    return length, bend
