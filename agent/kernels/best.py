"""Kernels of the choice of a target: the point with the greatest worth of its age per way."""

from __future__ import annotations

import numpy as np
from numba import njit, types

LENGTHS = types.Array(types.int32, 2, "C", readonly=True)
POINTS = types.Array(types.int32, 2, "C", readonly=True)
PATROLLED = types.Array(types.boolean, 2, "C", readonly=True)
TICKS = types.Array(types.int32, 2, "C", readonly=True)
WORTH = types.Array(types.float64, 1, "C", readonly=True)
PLACES = types.Array(types.int64, 2, "C", readonly=True)
SPOTS = types.Array(types.float64, 2, "C", readonly=True)
int64 = types.int64
float64 = types.float64
index = types.uint64
"""Unsigned, so that numba skips the negative-index check."""
NEVER = np.int32(2**31 - 1)
SEGMENT = 64
"""Columns that `oldest_that_may_win` looks at in one go."""
FOUND = types.Tuple((types.float64, *(types.int64,) * 5))  # type: ignore[no-untyped-call]
BEST = FOUND(
    POINTS, LENGTHS, int64, int64, int64, LENGTHS, PATROLLED, TICKS, TICKS, int64, WORTH, float64, float64, PLACES,
)  # fmt: skip


@njit(BEST, cache=True, nogil=True)
def best_of(
    posts, own, row0, col0, limit, rival, patrolled, last_seen, looked, tick, worth, near, others, left_out
):  # fmt: skip
    """Find the best of a box's points, and of points that are seen from posts in it.

    A point of age a at the end of a way of length L is worth ``worth[a] / (L + near)``, and ``others`` times that where
    a rival has the shorter way. Of equal points the first counts, row by row, those of the box before those with posts.
    Points that are in view now, and those around a place that is left out, do not count. For example, a worth of 60 at
    the end of a way of 500, with ``near`` 100, gives 0.1, and 0.05 where a rival is nearer and ``others`` is 0.5.

    Args:
        posts: int32 (n, 4), row and column of each point that has a post, and of the post.
        own: int32 (m, k), path lengths from the robot (`agent.routes.ground.BoxPaths`).
        row0: Row of the terrain under row 0 of ``own``.
        col0: Column of the terrain under column 0 of ``own``.
        limit: Longest way that counts, in hundredths of a point.
        rival: int32 (m, k), path lengths from the nearest rival; (0, 0) without any.
        patrolled: bool (h, w), the points that have an age.
        last_seen: int32 (h, w), when each point was last seen.
        looked: int32 (h, w), when each point was last in view.
        tick: Now.
        worth: float64 (a + 1,), by age in ticks.
        near: Added to each way, in hundredths of a point.
        others: Share that a rival's point counts.
        left_out: int64 (s, 3), row, column and squared radius of what is left out, in points.

    Returns:
        The best score, row and column of that point and of where to stand, and the length of the way; 0 without any.
    """
    score, rows, cols = 0.0, own.shape[0], own.shape[1]
    point_row = point_col = stand_row = stand_col = way = int64(0)
    for k in range(rows + posts.shape[0]):
        # One loop for both kinds: each row of the box, and then each post as a row of one point.
        row, up, first, end, shift = k + row0, k, int64(0), cols, col0
        if k >= rows:
            post = posts[k - rows]
            row, up, first = int64(post[0]), post[2] - row0, post[3] - col0
            # Chosen so that `across + shift` is the column of the point, where `across` is that of its post.
            shift = post[1] - first
            # An empty range where the post lies outside of the box.
            end = first + 1 if 0 <= first < cols and 0 <= up < rows else first
        for across in range(first, end):
            length, col = int64(own[index(up), index(across)]), across + shift
            if length > limit:  # such as the frame of the box, which may lie outside of the terrain
                continue
            # Never seen is -1 and counts as seen at tick 0.
            age = tick - max(int64(last_seen[index(row), index(col)]), 0)
            # Multiplied instead of divided, which takes longer: most points fail here.
            if age <= 0 or not patrolled[index(row), index(col)] or worth[index(age)] <= score * (length + near):
                continue
            # A sensor of low quality leaves an age to points in view, but going there shows nothing new.
            if looked[index(row), index(col)] == tick:
                continue
            candidate = worth[index(age)] / (length + near)
            if rival.size != 0 and rival[index(up), index(across)] < length:
                candidate *= others
            for place_left_out in range(left_out.shape[0]):
                off_row = up + row0 - left_out[place_left_out, 0]
                off_col = across + col0 - left_out[place_left_out, 1]
                if off_row * off_row + off_col * off_col <= left_out[place_left_out, 2]:
                    candidate = 0.0
            # Strictly more, so that of equal points the first one counts.
            if candidate > score:
                score, way = candidate, length
                point_row, point_col, stand_row, stand_col = row, col, up + row0, across + col0
    return score, point_row, point_col, stand_row, stand_col, way


@njit(
    int64(PATROLLED, TICKS, int64, int64, int64, int64, int64, WORTH, float64, float64, int64), cache=True, nogil=True
)
def oldest_that_may_win(patrolled, last_seen, tick, row, col, reach, gap, worth, near, score, most):
    """Return the greatest age, in ticks, of the points that could have a score if the way to them were straight.

    For example, a point 3 rows and 5 columns away with a gap of 1 counts as at least 482 away: 2 diagonal steps and 2
    straight ones.

    Args:
        patrolled: bool (h, w), the points that have an age.
        last_seen: int32 (h, w), when each point was last seen.
        tick: Now.
        row: Of the robot.
        col: Of the robot.
        reach: Rows and columns from the robot to the farthest points that are looked at.
        gap: Rows and columns by which the place to see a point from may be nearer than the point.
        worth: float64 (a + 1,), by age in ticks.
        near: Added to each way, in hundredths of a point.
        score: To be reached.
        most: The age at which the search may end: the greatest, or one as great as this.
    """
    oldest = int64(0)
    for k in range(max(row - reach, 0), min(row + reach + 1, last_seen.shape[0])):
        line, counts, up = last_seen[k], patrolled[k], max(abs(k - row) - gap, 0)
        right = min(col + reach + 1, line.size)
        for begin in range(max(col - reach, 0), right, SEGMENT):
            end = min(begin + SEGMENT, right)
            # Most segments are ruled out by their stalest point, as near as the nearest of them.
            earliest = NEVER
            for j in range(begin, end):
                earliest = min(earliest, line[index(j)] if counts[index(j)] else NEVER)
            # Straight steps alone are a lower bound of the way to any point of the segment, so no winner is ruled out.
            nearest = max(begin - col - gap, col - gap - end + 1, up, 0)
            age = tick - max(int64(earliest), 0)
            if age <= oldest or worth[index(age)] < score * (100 * nearest + near):
                continue
            for j in range(begin, end):
                age = tick - max(int64(line[index(j)]), 0)
                if age > oldest and counts[index(j)]:
                    across = max(abs(j - col) - gap, 0)
                    if worth[index(age)] >= score * (100 * max(up, across) + 41 * min(up, across) + near):
                        oldest = age
            if oldest >= most:
                return oldest
    return oldest


@njit(int64(LENGTHS, LENGTHS, int64), cache=True, nogil=True)
def longest_own_way(own, rival, limit):
    """Return the length of the longest way within a limit that no rival has a shorter way for, 0 without any.

    For example, with ways of 300, 500 and 900, a rival's of 400, 400 and 950, and a limit of 1000, it is 900.

    Args:
        own: int32 (m, k), path lengths from the robot (`agent.routes.ground.BoxPaths`).
        rival: int32 (m, k), path lengths from the nearest rival; (0, 0) without any.
        limit: Longest way that counts, in hundredths of a point.
    """
    longest = int64(0)
    for row in range(own.shape[0]):
        for col in range(own.shape[1]):
            length = int64(own[row, col])
            # Equally long ways are the robot's own, as in `best_of`.
            if longest < length <= limit and (rival.size == 0 or length <= rival[row, col]):
                longest = length
    return longest


@njit(types.boolean(SPOTS, float64, float64, float64), cache=True, nogil=True)
def any_nearer(spots, x, y, longest):
    """Return True if the way from one of some spots to another one, with nothing in between, is shorter than m.

    For example, the way from (0, 0) to (3, 4) is 5.23 m: 3 m of diagonal steps, at 1.41 each, and 1 m straight on.

    Args:
        spots: float64 (n, 2), x and y in m.
        x: Of the other one, m.
        y: Likewise.
        longest: Of the way over the eight neighbours of points, m.
    """
    for spot in range(spots.shape[0]):
        across, up = abs(spots[spot, 0] - x), abs(spots[spot, 1] - y)
        if max(across, up) + 0.41 * min(across, up) < longest:
            return True
    return False


@njit(types.Array(int64, 1, "C")(SPOTS, float64, float64, float64, float64), cache=True, nogil=True)
def those_within(spots, left, bottom, right, top):
    """Return which of some spots lie inside of a rectangle, int64 (k,), ascending.

    Args:
        spots: float64 (n, 2), x and y in m.
        left: Least x, m; a spot on the rim is not inside.
        bottom: Least y, m.
        right: Greatest x, m.
        top: Greatest y, m.
    """
    inside, count = np.empty(spots.shape[0], dtype=np.int64), 0
    for spot in range(spots.shape[0]):
        if left < spots[spot, 0] < right and bottom < spots[spot, 1] < top:
            inside[count] = spot
            count += 1
    return inside[:count]
