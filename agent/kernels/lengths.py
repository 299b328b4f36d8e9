"""Kernels of lengths alone: as `agent.kernels.wave`, without bends, and from several starts at once.

Over open ground a path is a straight run of points, and a run is written in one go, point after point, until it meets a
point that is no farther without it. What it writes may be improved by a later run. To keep that rare, runs pause at the
end of each stretch of lengths until all runs have come so far. This finds lengths up to twice as fast as from point to
point, nearest first.

A cell is length * 2 + BESIDE; that of a blocked point is 0, and that of a point without a path has the length UNKNOWN.
"""

from __future__ import annotations

from numba import njit, types

ALL_WAYS = 8
"""In an entry: go on in all directions. Directions 0 to 3 are diagonal, 4 to 7 straight."""

BESIDE = 1
"""In a cell: next to a blocked point, or a start."""

UNKNOWN = 2**27 - 1
"""In a cell: the length of a path that is not known."""

STRETCH = 2400
"""Lengths, in hundredths of a point, after which runs wait for each other."""

STRAIGHT_STEP, DIAGONAL_STEP = 200, 282
"""Steps of a path, in cells: twice their length in hundredths of a point."""

FAR = 2**31 - 1
"""As in `agent.kernels.wave`."""

CELLS = types.Array(types.uint32, 1, "C")
GRID = types.Array(types.uint8, 2, "C", readonly=True)
LISTS = types.Array(types.uint32, 2, "C")
FOUND = types.Array(types.int32, 2, "C")
STARTS = types.Array(types.int64, 1, "C", readonly=True)
int64 = types.int64
index = types.uint64
"""As in `agent.kernels.wave`."""


# fmt: off
@njit(types.void(GRID, int64, int64, CELLS, int64, int64, int64, int64, int64), cache=True, nogil=True)
def _clear(state, row0, col0, cell, cols, top, bottom, left, right):
    """Make the cells of a box ready, with all paths unknown; see `spread`."""
    for row in range(top, bottom):
        line = cell[row * cols + left : row * cols + right]
        if row == top or row == bottom - 1:
            line[:] = 0
            continue
        known = state[row0 + row, col0 + left : col0 + right]
        for k in range(line.size):
            line[k] = UNKNOWN << 1 | (known[k] & 4) >> 2 if known[k] & 3 != 0 else 0
        line[0] = line[line.size - 1] = 0


@njit(types.boolean(CELLS, int64, LISTS, int64, int64), cache=True, nogil=True)
def _run(cell, cols, lists, starts, limit):
    """Let paths run from the entries in the first of the lists.

    Args:
        cell: See `spread`.
        cols: See `spread`.
        lists: See `spread`.
        starts: Number of entries.
        limit: Longest path to follow, in hundredths of a point.

    Returns:
        See `spread`.
    """
    waiting, end, now, later, room = starts, 0, lists[0], lists[1], lists.shape[1] - 8
    while waiting > 0 and waiting < room and end < limit:
        end = min(end + STRETCH, limit)
        stop = end << 1 | 1
        done, put = 0, 0
        while done < waiting < room and put < room:
            entry = int64(now[index(done)])
            done += 1
            here, only = entry >> 4, entry & 15
            known = int64(cell[index(here)])
            if known > stop:
                later[index(put)] = entry
                put += 1
                continue
            for way in range(4):
                if only != ALL_WAYS and only & 3 != way:
                    continue
                across, up = 1 if way % 3 == 0 else -1, cols if way < 2 else -cols
                way_across, way_up = 4 if across == 1 else 6, 5 if up > 0 else 7
                at, far = here, known & ~1
                # A diagonal run has straight ones to both sides at each of its points, but not where all ways begin.
                sides, straight, step = 2, way_across, across
                if only > 3:
                    sides, straight, step = 1, way + 4, (1, cols, -1, -cols)[way]
                while waiting < room and put < room:
                    for side in range(sides):
                        if side == 1:
                            straight, step = way_up, up
                        there, away = at + step, far + STRAIGHT_STEP
                        beyond = int64(cell[index(there)])
                        while away < beyond & ~1:
                            cell[index(there)] = away | beyond & 1
                            if beyond & BESIDE != 0 or away > stop:
                                on = there << 4 | (ALL_WAYS if beyond & BESIDE != 0 else straight)
                                if away > stop:
                                    later[index(put)] = on
                                    put += 1
                                else:
                                    now[index(waiting)] = on
                                    waiting += 1
                                break
                            there += step
                            away += STRAIGHT_STEP
                            beyond = int64(cell[index(there)])
                    if only < ALL_WAYS and only > 3:
                        break
                    if sides == 1 and (cell[index(at + across)] == 0 or cell[index(at + up)] == 0):
                        break
                    sides, straight, step = 2, way_across, across
                    at += across + up
                    far += DIAGONAL_STEP
                    beyond = int64(cell[index(at)])
                    if far >= beyond & ~1:
                        break
                    cell[index(at)] = far | beyond & 1
                    if beyond & BESIDE != 0 or far > stop:
                        on = at << 4 | (ALL_WAYS if beyond & BESIDE != 0 else way)
                        if far > stop:
                            later[index(put)] = on
                            put += 1
                        else:
                            now[index(waiting)] = on
                            waiting += 1
                        break
        if max(waiting, put) >= room:
            return False
        now, later = later, now
        waiting = put
    return waiting < room


@njit(
    types.boolean(GRID, int64, int64, CELLS, int64, LISTS, STARTS, int64, int64, int64, int64, int64),
    cache=True,
    nogil=True,
)
def spread(state, row0, col0, cell, cols, lists, starts, limit, top, bottom, left, right):
    """Write the lengths of the paths from the nearest of several starts.

    Args:
        state: uint8, see `agent.kernels.wave.HEMMED`.
        row0: Row of ``state`` over the window's first row.
        col0: Column of ``state`` over the window's first column.
        cell: uint32, flat over the window, see above; overwritten in a box, whose outermost points are taken for
            blocked. Only lengths up to ``limit`` are sure to be right, of paths that do not leave the box.
        cols: Columns of the window.
        lists: uint32 (2 or more, k), working memory.
        starts: int64 (s,), flat indices of the starts, which are open and lie within the box.
        limit: Longest path to follow, in hundredths of a point; at most 2**26.
        top: First row of the box in the window.
        bottom: End row, exclusive.
        left: First column.
        right: End column, exclusive.

    Returns:
        Whether there was room enough in ``lists``; if not, nothing that was written has any meaning.
    """
    _clear(state, row0, col0, cell, cols, top, bottom, left, right)
    for k in range(min(starts.size, lists.shape[1] - 8)):
        cell[index(starts[k])] = BESIDE
        lists[0, k] = starts[k] << 4 | ALL_WAYS
    return _run(cell, cols, lists, starts.size, limit)


@njit(types.void(CELLS, FOUND, int64), cache=True, nogil=True)
def read(cell, length, limit):
    """Write the lengths that `spread` has found.

    Args:
        cell: uint32 (m n,), as `spread` left it.
        length: int32 (m, n), overwritten: in hundredths of a point, FAR where no path is as short as the limit.
        limit: Longest path.
    """
    found = length.reshape(-1)
    past = types.uint32((limit + 1) << 1)
    for k in range(found.size):
        found[k] = cell[k] >> types.uint32(1) if cell[k] < past and cell[k] != 0 else FAR


# fmt: on
