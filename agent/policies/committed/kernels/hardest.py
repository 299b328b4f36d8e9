"""Kernels of commitment: the one point that pulls hardest, and how far a robot's claimed ground reaches."""

from __future__ import annotations

import math

from numba import njit, types

GRID = types.Array(types.int32, 2, "C", readonly=True)
STATE = types.Array(types.uint8, 2, "C", readonly=True)
TABLE = types.Array(types.float64, 1, "C", readonly=True)
BEST = types.Array(types.float64, 1, "C")
PLACES = types.Array(types.int64, 1, "C")
SHUNNED = types.Array(types.int64, 2, "C", readonly=True)
ROWS = types.Array(types.int32, 2, "C", readonly=True)
int64 = types.int64
float64 = types.float64
index = types.uint64
"""Of what is sure not to be negative: a negative index would have to be asked for and counted from the end."""

UNKNOWN = 2**31 - 1
"""The length of an unknown path."""


@njit(types.void(STATE, GRID, GRID, int64, int64, int64, int64, int64, PLACES), cache=True, nogil=True)
def reaches(state, length, rival, hand_over, top, bottom, left, right, longest):
    """The longest path of all, the longest to a point that no rival is nearer to, or nearer by more than some length.

    Args:
        state: uint8 (m, n), the wave's grid over its window; only settled points count.
        length: int32 (m, n), path lengths in hundredths of a point.
        rival: int32 (m, n), path lengths from the nearest rival; size 0 without rivals.
        hand_over: By how much a rival must be nearer, in hundredths of a point.
        top: First row of the window's part that holds all settled points.
        bottom: End row of that part, exclusive.
        left: First column of it.
        right: End column of it, exclusive.
        longest: int64 (3,), filled in with these lengths in hundredths of a point; 0 without such a point.
    """
    most, own, handed = 0, 0, 0
    for row in range(top, bottom):
        known, far = state[row, left:right], length[row, left:right]
        other = rival[row, left:right] if rival.size > 0 else far
        for col in range(known.size):
            settled = known[col] & 3 == 3
            most = max(most, far[col] if settled else 0)
            own = max(own, far[col] if settled and far[col] <= other[col] else 0)
            handed = max(handed, far[col] if settled and far[col] - other[col] <= hand_over else 0)
    longest[0], longest[1], longest[2] = most, own, handed


# fmt: off
@njit(
    [
        types.void(
            posts, STATE, GRID, int64, int64, int64, int64, int64, int64, GRID, GRID, int64, int64, TABLE, TABLE, GRID,
            float64, int64, SHUNNED, int64, int64, int64, BEST, PLACES,
        )
        for posts in (types.none, ROWS)
    ],
    cache=True,
    nogil=True,
)
def hardest(
    posts, state, length, row0, col0, top, bottom, left, right, seen, looked, tick, least, log_pull, log_decay, rival,
    width, hand_over, shunned, home_row, home_col, home_squared, best, place,
):
    """Find the point with the greatest force, as logarithms: f and g may be too small for a float.

    Args:
        posts: None for the points on which a body can stand. Otherwise int32 (n, 4) of `agent.belief.posts.Posts`: such
            a point pulls from its post.
        state: uint8 (m, n), the wave's grid over its window; points that are not settled exert no force.
        length: int32 (m, n), path lengths in hundredths of a point.
        row0: Row of the terrain's point under element (0, 0) of the window.
        col0: Column of the same point.
        top: First row of the window's part that holds all settled points.
        bottom: End row of that part, exclusive.
        left: First column of it.
        right: End column of it, exclusive.
        seen: int32 (h, w), the tick at which each point was last seen; -1 counts as 0, and a value above ``tick`` means
            that the point has no age.
        looked: int32 (h, w), the tick at which each point was last in view.
        tick: Now.
        least: Points younger than this are left out, ticks; 1 or more.
        log_pull: float64 (mfow + 1,), log f by age in ticks.
        log_decay: float64, log g by length in hundredths of a point, at least up to the longest settled path.
        rival: int32 (m, n), path lengths from the nearest rival, in hundredths of a point; size 0 without rivals.
        width: Of the claims, in hundredths of a point; 0 without claims.
        hand_over: Points that a rival has a way to that is shorter by more than this are left out, in hundredths of a
            point.
        shunned: int64 (n, 3), row, column and squared radius, in points of the terrain, of the places to stand on that
            are left out.
        home_row: Row in the terrain of the centre of the circle in which the robot must not stand.
        home_col: Column of the same centre.
        home_squared: Squared radius of the circle, in points; negative for no circle.
        best: float64 (1,), the greatest logarithm so far; updated in place.
        place: int64 (4,), row and column in the terrain of the point that exerts it and of the place to stand on;
            updated in place.
    """
    if posts is None:
        first, end, left_col, right_col = top, bottom, left, right
    else:
        first, end, left_col, right_col = 0, posts.shape[0], 0, 1
    most = best[0]
    for i in range(first, end):
        for j in range(left_col, right_col):
            if posts is None:
                row, col, seen_row, seen_col = i, j, row0 + i, col0 + j
            else:
                row, col, seen_row, seen_col = posts[i, 2] - row0, posts[i, 3] - col0, posts[i, 0], posts[i, 1]
                if row < top or row >= bottom or col < left or col >= right:
                    continue
            if state[index(row), index(col)] & 3 != 3:
                continue
            age = tick - max(int64(seen[index(seen_row), index(seen_col)]), 0)
            if age < least or looked[index(seen_row), index(seen_col)] >= tick:
                continue
            far = max(int64(length[index(row), index(col)]), 1)
            nearest = int64(rival[index(row), index(col)]) if rival.size > 0 else UNKNOWN
            if far - nearest > hand_over:
                continue
            force = log_pull[index(min(age, log_pull.size - 1))] + log_decay[index(far)]
            if force <= most:
                continue
            if width > 0.0:
                behind = (far - nearest) / width
                force -= behind if behind > 40.0 else math.log1p(math.exp(max(behind, -40.0)))
                if force <= most:
                    continue
            up, across = row0 + row - home_row, col0 + col - home_col
            away = up * up + across * across > home_squared
            for k in range(shunned.shape[0]):
                up, across = row0 + row - shunned[k, 0], col0 + col - shunned[k, 1]
                away = away and up * up + across * across > shunned[k, 2]
            if away:
                most = force
                place[0], place[1], place[2], place[3] = seen_row, seen_col, row0 + row, col0 + col
    best[0] = most


# fmt: on
