"""Kernels of the wave: path lengths and first bends from one point to all others (paper, "The wave").

Steps go to the eight neighbours and cost 100 along a row or column and 141 along a diagonal, so that equal lengths are
equal integers; a diagonal step needs both points beside it. Of equally long paths, one whose last step is diagonal
counts as the nearer one; `ties` decides what is left. Where such a path takes a point over and does not go on straight
as the other one did, a shorter way leads past the point, so nothing has to be taken back.

Only neighbours that can lie on a new shortest path are tried: where all eight neighbours are open, a path that came
straight goes on straight, and one that came diagonally goes on diagonally or turns into either of its components.
Next to an obstacle all eight are tried. Lengths stay exact.

So over open ground a path is a straight run of points, and a run is written in one go, point after point, until it
meets a point that is no farther without it. What it writes may be improved by a later run. To keep that rare, runs
pause at the end of each stretch of lengths until all runs have come so far.

What is done at the end of a run is written out wherever one ends, here and in `lengths`: as a kernel of its own that
these call, it made the wave on `site` three to four times slower.

A point's cell holds its length and what else a run asks for: length * 32 + direction of the last step * 4 + SEEN +
BESIDE. Directions 0 to 3 are diagonal, 4 to 7 straight, so that cells without their four low bits compare as paths do.
A blocked point's cell is 0, and that of a point without a path has the length UNKNOWN.
"""

from __future__ import annotations

from numba import njit, types

BLOCKED = 0
OPEN = 1
SETTLED = 3
STATUS = 3
HEMMED = 4
"""A point's state: its status in the two low bits, and HEMMED when one of its eight neighbours is blocked."""

BESIDE = 1
"""In a cell: next to a blocked point, or the start."""

SEEN = 2
"""In a cell: the straight line from the start is free."""

UNKNOWN = 2**27 - 1
"""In a cell: the length of a path that is not known."""

FAR = 2**31 - 1
"""The length shown where no path is settled."""

ALL_WAYS = 8
"""In an entry: go on in all directions."""

STRETCH = 2400
"""Lengths, in hundredths of a point, after which runs wait for each other."""

NOW, LATER, TIES, BEYOND, FULL, ROW, DONE, BENT = 0, 1, 2, 3, 4, 5, 6, 7
"""What `mark` holds: the numbers of entries of this stretch, of later ones, of points with ties and of entries for
`bends`, whether there was no room for one, the row of `lists` for this stretch, the length up to which paths are
settled, and the one up to which first bends are found."""

CELLS = types.Array(types.uint32, 1, "C")
GRID = types.Array(types.uint8, 2, "C", readonly=True)
STATE = types.Array(types.uint8, 2, "C")
LENGTHS = types.Array(types.int32, 2, "C")
LISTS = types.Array(types.uint32, 2, "C")
MARK = types.Array(types.int64, 1, "C")
int64 = types.int64
index = types.uint64
"""Of what is sure not to be negative: a negative index would have to be asked for and counted from the end."""


@njit(types.void(GRID, GRID, CELLS, int64, int64, int64, int64), cache=True, nogil=True)
def lay(state, sight, cell, top, bottom, left, right):
    """Make the cells of a box ready: blocked, or without a path.

    Args:
        state: uint8 (m, n), see HEMMED.
        sight: uint8 (m, n), 1 where the straight line from the start is free.
        cell: uint32 (m n,), overwritten in the box.
        top: First row of the box.
        bottom: End row, exclusive.
        left: First column.
        right: End column, exclusive.
    """
    cols = state.shape[1]
    for row in range(top, bottom):
        known, seen = state[row, left:right], sight[row, left:right]
        line = cell[row * cols + left : row * cols + right]
        for k in range(right - left):
            flags = (known[k] & 4) >> 2 | seen[k] << 1
            line[k] = UNKNOWN << 5 | flags if known[k] & 3 != 0 else 0


@njit(types.void(CELLS, STATE, LENGTHS, int64, int64, int64, int64, int64, int64), cache=True, nogil=True)
def show(cell, state, length, shift, limit, top, bottom, left, right):
    """Write the settled paths of a box of cells as states and lengths.

    Args:
        cell: uint32 (m n,), settled cells.
        state: uint8 (m, n), see HEMMED; SETTLED is set.
        length: int32 (m, n), path lengths in hundredths of a point; overwritten in the box, FAR where no path is
            settled.
        shift: By how many bits lengths are shifted in the cells.
        limit: Longest settled path.
        top: First row of the box.
        bottom: End row, exclusive.
        left: First column.
        right: End column, exclusive.
    """
    cols = state.shape[1]
    beyond = types.uint32((limit + 1) << shift)
    by = types.uint32(shift)
    for row in range(top, bottom):
        known, far = state[row, left:right], length[row, left:right]
        line = cell[row * cols + left : row * cols + right]
        for k in range(right - left):
            settled = line[k] < beyond and known[k] != 0
            far[k] = line[k] >> by if settled else FAR
            known[k] |= 3 if settled else 0


@njit(types.void(CELLS, LISTS, MARK, int64, int64), cache=True, nogil=True)
def settle(cell, lists, mark, stride, limit):
    """Settle every point whose path is at most ``limit`` long, but for ties.

    All grids are flat over a window of ``stride`` columns whose outermost points are blocked. A wave begins with the
    start's length 0, BESIDE set in its cell, the one entry start * 16 + ALL_WAYS, and ``mark`` 0 except
    mark[NOW] = 1. A later call with a larger limit continues from there.

    Args:
        cell: uint32, see above; changed in place.
        lists: uint32 (5, k), entries from which paths go on in this stretch and later, index * 16 + direction, and the
            indices of points with ties; changed in place. The last two rows are for `bends`.
        mark: int64 (8,), see NOW; changed in place. Where mark[FULL] is set afterwards, nothing that was written has
            any meaning.
        stride: Columns of the window.
        limit: Longest path to settle, in hundredths of a point; at most 2**26.
    """
    room = lists.shape[1] - 8
    ties, tied = lists[2], mark[TIES]
    waiting, end = mark[NOW], mark[DONE]
    while waiting > 0 and end < limit and mark[FULL] == 0:
        end = min(end + STRETCH, limit)
        stop = end << 5 | 31
        now, later = lists[mark[ROW]], lists[1 - mark[ROW]]
        done, put = 0, 0
        while done < waiting < room and put < room and tied < room:
            entry = int64(now[index(done)])
            done += 1
            here, only = entry >> 4, entry & 15
            known = int64(cell[index(here)])
            if known > stop:
                later[index(put)] = entry
                put += 1
                continue
            if only != ALL_WAYS and known >> 2 & 7 != only:
                continue  # A nearer path has come since, and goes on by itself.
            for way in range(4):
                if only != ALL_WAYS and only & 3 != way:
                    continue
                across, up = 1 if way % 3 == 0 else -1, stride if way < 2 else -stride
                way_across, way_up = 4 if across == 1 else 6, 5 if up > 0 else 7
                at, far = here, known >> 5
                # A diagonal run has straight ones to both sides at each of its points, but not where all ways begin.
                sides, straight, step = 2, way_across, across
                if only > 3:
                    sides, straight, step = 1, way + 4, (1, stride, -1, -stride)[way]
                while waiting < room and put < room and tied < room:
                    for side in range(sides):
                        if side == 1:
                            straight, step = way_up, up
                        there, label = at + step, (far + 100) << 5 | straight << 2
                        known_there = int64(cell[index(there)])
                        while label >> 4 < known_there >> 4:
                            cell[index(there)] = label | known_there & 3
                            if known_there & BESIDE != 0 or label > stop:
                                on = there << 4 | (ALL_WAYS if known_there & BESIDE != 0 else straight)
                                if label > stop:
                                    later[index(put)] = on
                                    put += 1
                                else:
                                    now[index(waiting)] = on
                                    waiting += 1
                                break
                            there += step
                            label += 100 << 5
                            known_there = int64(cell[index(there)])
                        else:
                            if label >> 4 == known_there >> 4 and label >> 2 != known_there >> 2:
                                ties[index(tied)] = there
                                tied += 1
                    if only < ALL_WAYS and only > 3:
                        break
                    if sides == 1 and (cell[index(at + across)] == 0 or cell[index(at + up)] == 0):
                        break
                    sides, straight, step = 2, way_across, across
                    at += across + up
                    far += 141
                    label = far << 5 | way << 2
                    known_there = int64(cell[index(at)])
                    if label >> 4 >= known_there >> 4:
                        if label >> 4 == known_there >> 4 and label >> 2 != known_there >> 2:
                            ties[index(tied)] = at
                            tied += 1
                        break
                    cell[index(at)] = label | known_there & 3
                    if known_there & BESIDE != 0 or label > stop:
                        on = at << 4 | (ALL_WAYS if known_there & BESIDE != 0 else way)
                        if label > stop:
                            later[index(put)] = on
                            put += 1
                        else:
                            now[index(waiting)] = on
                            waiting += 1
                        break
                    if known_there >> 5 == far:
                        # An equally long straight path was here before. To the one side it has gone on itself; past
                        # the other one a shorter diagonal leads.
                        sides = 0
        if max(waiting, put, tied) >= room:
            mark[FULL] = 1
        waiting = put
        mark[ROW] = 1 - mark[ROW]
    mark[NOW], mark[TIES], mark[DONE] = waiting, tied, limit
