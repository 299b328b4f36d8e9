"""Kernels of commitment over strips: parts of rows, most of which hold no point that could pull hardest."""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types

CELLS = types.Array(types.uint32, 2, "C", readonly=True)
SEEN = types.Array(types.int32, 2, "C", readonly=True)
TABLE = types.Array(types.float64, 1, "C", readonly=True)
OTHERS = types.Array(types.int64, 2, "C", readonly=True)
ROWS = types.Array(types.int32, 2, "C", readonly=True)
INTS = types.Array(types.int32, 2, "C")
BOUNDS = types.Array(types.float64, 2, "C")
BEST = types.Array(types.float64, 1, "C")
PLACES = types.Array(types.int64, 1, "C")
int64 = types.int64
float64 = types.float64
index = types.uint64
"""Of what is sure not to be negative: a negative index would have to be asked for and counted from the end."""

STRIP = 64
"""Columns of a strip."""

UNKNOWN = 2**31 - 1
"""The length of an unknown path, and the tick at which a strip without paths was seen."""

DECIDED = 40.0
"""Number of widths beyond which a claim is decided."""


@njit(types.void(CELLS, int64, SEEN, int64, int64, int64, TABLE, TABLE, BOUNDS), cache=True, nogil=True)
def survey(cell, limit, seen, row0, col0, tick, log_pull, log_decay, bounds):
    """The shortest path to each strip, and what no point of the strip pulls harder than.

    That is how hard a point would pull if it had the shortest path and were as old as the oldest one.

    Args:
        cell: uint32 (m, n), see `agent.routes.kernels.lengths`.
        limit: Longest path that counts, in hundredths of a point.
        seen: int32 (h, w), the tick at which each point was last seen.
        row0: Row of ``seen`` under row 0 of the cells.
        col0: Column of ``seen`` under column 0 of the cells.
        tick: Now.
        log_pull: As of `agent.policies.committed.kernels.hardest.hardest`.
        log_decay: As there, up to ``limit``.
        bounds: float64 (m, s), the bounds; filled in, minus infinity where there is no path.
    """
    rows, cols = cell.shape
    most = types.uint32(2 * limit)
    for row in range(rows):
        for strip in range(bounds.shape[1]):
            first = max(1, strip * STRIP)
            end = max(first, min(strip * STRIP + STRIP, cols - 1))
            least, since = types.uint32(UNKNOWN), types.int32(UNKNOWN)
            if 0 < row < rows - 1:
                known, when = cell[row, first:end], seen[row0 + row, col0 + first : col0 + end]
                for k in range(known.size):
                    # One less than a cell is beyond all others where it is blocked.
                    settled = known[k] - types.uint32(1) <= most
                    least = min(least, known[k] if settled else types.uint32(UNKNOWN))
                    since = min(since, when[k] if settled else types.int32(UNKNOWN))
            bounds[row, strip] = -math.inf
            if least < types.uint32(UNKNOWN):
                age = min(max(tick - max(int64(since), 0), 0), log_pull.size - 1)
                bounds[row, strip] = log_pull[age] + log_decay[max(int64(least >> types.uint32(1)), 1)]


@njit(int64(ROWS, CELLS, int64, int64, int64, SEEN, int64, int64, INTS), cache=True, nogil=True)
def posts_within(posts, cell, row0, col0, limit, seen, tick, least, found):
    """Find the posts to which a path leads, of points that are old enough.

    Args:
        posts: int32 (n, 4) of `agent.belief.posts.Posts`, sorted by post.
        cell: uint32 (m, n), see `agent.routes.kernels.lengths`.
        row0: Row of the terrain's point under row 0 of the cells.
        col0: Column of the same point.
        limit: Longest path that counts, in hundredths of a point.
        seen: int32 (h, w), the tick at which each point was last seen.
        tick: Now.
        least: Points younger than this are left out, ticks.
        found: int32 (n, 4), overwritten with their entries.

    Returns:
        Their number.
    """
    rows, cols = cell.shape
    most, count, begin = 2 * limit + 1, 0, 0
    for row in range(1, rows - 1):
        # The first post of this row that is not left of the cells.
        low, high = begin, posts.shape[0]
        while low < high:
            middle = (low + high) // 2
            there = int64(posts[index(middle), 2])
            if there < row0 + row or (there == row0 + row and posts[index(middle), 3] <= col0):
                low = middle + 1
            else:
                high = middle
        begin = low
        while begin < posts.shape[0]:
            at = index(begin)
            col = int64(posts[at, 3]) - col0
            if posts[at, 2] != row0 + row or col >= cols - 1:
                break
            known = int64(cell[index(row), index(col)])
            if 0 < known <= most and tick - max(int64(seen[index(posts[at, 0]), index(posts[at, 1])]), 0) >= least:
                for k in range(4):
                    found[index(count), k] = posts[at, k]
                count += 1
            begin += 1
    return count


# fmt: off
@njit(
    types.void(
        BOUNDS, float64, ROWS, CELLS, int64, int64, int64, SEEN, SEEN, int64, int64, TABLE, TABLE, OTHERS, CELLS, int64,
        int64, int64, float64, int64, OTHERS, BEST, PLACES, PLACES,
    ),
    cache=True,
    nogil=True,
)
def hardest_of(
    bounds, floor, posts, cell, row0, col0, limit, seen, looked, tick, least, log_pull, log_decay, others, rival,
    rival_row0, rival_col0, rival_limit, width, hand_over, shunned, best, place, undecided,
):
    """Find the point with the greatest force among some strips; see `agent.policies.committed.kernels.hardest`.

    Without the rivals' paths, points to which a rival's path could be short enough to matter are left out, and noted if
    they exert a force that is great enough without any rival.

    Args:
        bounds: float64 (m, s), see `survey`. The strips are those with a bound of at least ``floor``.
        floor: The logarithm of a force.
        posts: int32 (n, 4) of `posts_within`, points on which no body can stand: such a point pulls from its post, in
            whatever strip that is. They are looked at after all strips.
        cell: uint32 (m, n), see `agent.routes.kernels.lengths`, of the robot's own paths.
        row0: Row of the terrain's point under row 0 of the cells.
        col0: Column of the same point.
        limit: Longest path that counts, in hundredths of a point.
        seen: As there.
        looked: As there.
        tick: Now.
        least: As there.
        log_pull: As there.
        log_decay: As there, up to ``limit``.
        others: int64 (r, 2), rows and columns of the terrain's points on which rivals stand.
        rival: uint32 (p, q), likewise, of the paths from the nearest rival; size 0 where they are not known.
        rival_row0: As row0, of the rivals' cells.
        rival_col0: As col0, of the rivals' cells.
        rival_limit: Longest path of a rival that counts, in hundredths of a point.
        width: As there.
        hand_over: As there.
        shunned: As there.
        best: As there.
        place: As there.
        undecided: int64 (6,), updated in place: the number of points that were left out, the longest path to one, and
            the first and last row and column of them.
    """
    (rows, cols), (_, in_row) = cell.shape, bounds.shape
    most, most_rival = 2 * limit + 1, 2 * rival_limit + 1
    decided = math.ceil(DECIDED * width)
    # Of all rivals, those whose paths may matter to some point of the cells.
    near, count_near = np.empty_like(others), 0
    for j in range(others.shape[0]):
        up = max(row0 + 1 - others[j, 0], others[j, 0] - (row0 + rows - 2), 0)
        across = max(col0 + 1 - others[j, 1], others[j, 1] - (col0 + cols - 2), 0)
        if 100 * max(up, across) + 41 * min(up, across) < limit + decided:
            near[count_near] = others[j]
            count_near += 1
    for part in range(bounds.size + 1):
        strip_row, strip = part // in_row, part % in_row
        count = posts.shape[0]
        if part < bounds.size:
            count = STRIP if bounds[strip_row, strip] >= floor else 0
        for k in range(count):
            row, col = strip_row, strip * STRIP + k
            seen_row, seen_col = row0 + row, col0 + col
            if part == bounds.size:
                row, col, seen_row, seen_col = posts[k, 2] - row0, posts[k, 3] - col0, posts[k, 0], posts[k, 1]
            if row < 1 or row >= rows - 1 or col < 1 or col >= cols - 1:
                continue
            known = int64(cell[index(row), index(col)])
            if known == 0 or known > most:
                continue
            age = tick - max(int64(seen[index(seen_row), index(seen_col)]), 0)
            if age < least or looked[index(seen_row), index(seen_col)] >= tick:
                continue
            far = max(known >> 1, 1)
            force = log_pull[index(min(age, log_pull.size - 1))] + log_decay[index(far)]
            if force < best[0]:
                continue
            nearest, matters = int64(UNKNOWN), False
            if rival.size > 0:
                up, across = row0 + row - rival_row0, col0 + col - rival_col0
                if 0 <= up < rival.shape[0] and 0 <= across < rival.shape[1]:
                    theirs = int64(rival[up, across])
                    nearest = theirs >> 1 if 0 < theirs <= most_rival else nearest
            else:
                for j in range(count_near):
                    up, across = abs(row0 + row - near[j, 0]), abs(col0 + col - near[j, 1])
                    matters = matters or 100 * max(up, across) + 41 * min(up, across) < far + decided
            if far - nearest > hand_over:
                continue
            if width > 0.0:
                behind = (far - nearest) / width
                weaker = force - (behind if behind > 40.0 else math.log1p(math.exp(max(behind, -40.0))))
            else:
                weaker = force
            if not matters and weaker <= best[0]:
                continue
            away = True
            for j in range(shunned.shape[0]):
                up, across = row0 + row - shunned[j, 0], col0 + col - shunned[j, 1]
                away = away and up * up + across * across > shunned[j, 2]
            if not away:
                continue
            if matters:
                place_row, place_col = row0 + row, col0 + col
                undecided[0] += 1
                undecided[1] = max(undecided[1], far)
                undecided[2], undecided[3] = min(undecided[2], place_row), max(undecided[3], place_row)
                undecided[4], undecided[5] = min(undecided[4], place_col), max(undecided[5], place_col)
            else:
                best[0] = weaker
                place[0], place[1], place[2], place[3] = seen_row, seen_col, row0 + row, col0 + col


# fmt: on
