"""Kernels of the force that the points of the terrain exert on a robot (paper, formula (1) and Table 1).

The modulus of a point's force is ``pull[age] * decay[length]``: f of the fog of war and g of the path's length,
tabulated for every age in ticks and every length in hundredths of a point. Its direction is the bearing of the path's
first bend.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types

INTS = types.Array(types.int32, 1, "C", readonly=True)
GRID = types.Array(types.int32, 2, "C", readonly=True)
STATE = types.Array(types.uint8, 2, "C", readonly=True)
SECTORS = types.Array(types.uint16, 2, "C", readonly=True)
TABLE = types.Array(types.float64, 1, "C", readonly=True)
SUMS = types.Array(types.float64, 1, "C")
PLACES = types.Array(types.int64, 1, "C")
ROWS = types.Array(types.int32, 2, "C", readonly=True)
float64 = types.float64
int64 = types.int64
boolean = types.boolean
index = types.uint64
"""Unsigned, so that numba skips the negative-index check."""


CLEAR = 1e-9
"""Distance to a sector's edge, in points, beyond which rounding cannot decide on which side a point is."""


EDGES = types.Array(types.float64, 2, "C")


@njit(types.boolean(EDGES, index, float64, float64), cache=True, nogil=True, forceinline=True)
def _lies_between(edges, sector, up, across):
    """Return True if an offset clearly lies between the edges of a sector, given as the x and y of their bearings."""
    after = edges[sector, 0] * up - edges[sector, 1] * across
    before = edges[sector + index(1), 1] * across - edges[sector + index(1), 0] * up
    return after > CLEAR and before > CLEAR


# fmt: off
@njit(
    [
        types.void(
            posts, STATE, GRID, GRID, int64, int64, int64, int64, int64, float64, float64, int64, int64,
            GRID, GRID, int64, TABLE, TABLE, GRID, TABLE, SECTORS, boolean, SUMS, SUMS, PLACES,
        )
        for posts in (types.none, ROWS)
    ],
    cache=True,
    nogil=True,
)
def gather(
    posts, state, length, bend, first, last, span, start_row, start_col, aside_up, aside_across, row0, col0,
    seen, looked, tick, pull, decay, rival, share, sector, as_vector, sums, strongest, source,
):
    """Add the forces of the points whose path is longer than ``first`` and at most ``last`` (paper, formula (1)).

    Args:
        posts: None for the points on which a body can stand, at most ``span`` rows and columns from the robot.
            Otherwise int32 (n, 4) of `agent.belief.posts.Posts`: patrolled points on which no body fits, row and
            column of each and of its post, as far as they may be near. Such a point pulls from its post, the nearest
            reachable point that sees it, because the robot only needs to go there.
        state: uint8 (m, n), the wave's grid over its window; points that are not settled exert no force.
        length: int32 (m, n), path lengths in hundredths of a point.
        bend: int32 (m, n), flat index into the window of each path's first bend.
        first: Exclusive lower bound of the path length, in hundredths of a point.
        last: Inclusive upper bound of the path length, in hundredths of a point; not less than `first`.
        span: Largest distance from the robot, in rows and in columns.
        start_row: The robot's row in the window; its own point exerts no force.
        start_col: The robot's column in the window.
        aside_up: Rows from the centre of that point to the place from which directions count.
        aside_across: Columns from there.
        row0: Row of the terrain's point under element (0, 0) of the window.
        col0: Column of the same point.
        seen: int32 (h, w), the (dilated) tick at which each point was last seen; -1 counts as 0, and a value above
            ``tick`` means that the point has no age.
        looked: int32 (h, w), the tick at which each point was last in view; ``seen`` where a look makes a point fresh.
        tick: Now.
        pull: float64 (a + 1,), f by age in ticks; greater ages count as a.
        decay: float64 (limit + 1,), g by length in hundredths of a point.
        rival: int32 (m, n), path lengths from the nearest rival, in hundredths of a point.
        share: float64 (2 s + 1,), the share of a force that claims leave, by how much farther away the robot is than
            its nearest rival, in hundredths of a point plus s; size 0 without claims.
        sector: uint16 (2 r + 1, 2 r + 1), the sector of a bearing by its offset in rows and columns plus r.
        as_vector: Whether to sum a vector instead of sectors.
        sums: float64 (sectors,), the sum of moduli in each sector; with ``as_vector`` float64 (3,), the vector sum's x
            and y and the sum of moduli. Added to in place.
        strongest: float64 (1,), the largest single force so far of a point that is not in view now; updated in place.
        source: int64 (1,), the window's flat index of the point to stand on for that force; updated in place.
    """
    rows, cols = state.shape
    middle = sector.shape[0] // 2
    half, widest, oldest = share.size // 2, share.size - 1, pull.size - 1
    if posts is None:
        top, bottom = max(0, start_row - span), min(rows, start_row + span + 1)
        left, right = max(0, start_col - span), min(cols, start_col + span + 1)
    else:
        top, bottom, left, right = 0, posts.shape[0], 0, 1
    # No path is shorter than the straight line, but a diagonal step, which is 0.3 % longer than its 1.41, and rounding.
    reach = 1.003 * last / 100.0 + 2.0
    peak, most_at = strongest[0], source[0]
    # Neighbours often share their bend, and mostly their sector, so its sum stays at hand until another one's turn.
    up, across, turned = 0.0, 0.0, -1
    is_aside = aside_up != 0.0 or aside_across != 0.0
    edges = np.empty((sums.size + 1 if is_aside else 0, 2))
    for number in range(edges.shape[0]):
        bearing = (number - 0.5) * math.tau / sums.size
        edges[number, 0], edges[number, 1] = math.cos(bearing), math.sin(bearing)
    slot = index(0)
    total, along, upwards = sums[0], 0.0, 0.0
    if as_vector:
        along, upwards, total = sums[0], sums[1], sums[2]
    for i in range(top, bottom):
        low, high = left, right
        if posts is None:
            away = int(math.sqrt(max(reach * reach - (i - start_row) ** 2, 0.0)))
            low, high = max(left, start_col - away), min(right, start_col + away + 1)
        for j in range(low, high):
            if posts is None:
                row, col, seen_row, seen_col = i, j, row0 + i, col0 + j
            else:
                # The robot goes to the post, but the age is that of the point.
                row, col, seen_row, seen_col = posts[i, 2] - row0, posts[i, 3] - col0, posts[i, 0], posts[i, 1]
                if row < 0 or row >= rows or col < 0 or col >= cols:
                    continue
            far = int64(length[index(row), index(col)])
            # The two low bits are the wave's status, where 3 is settled.
            # Unsigned, so that one comparison excludes both lengths up to `first` and those beyond `last`.
            if index(far - first - 1) >= index(last - first) or state[index(row), index(col)] & 3 != 3:
                continue
            when = int64(seen[index(seen_row), index(seen_col)])
            if when > tick:
                continue
            force = pull[index(min(tick - max(when, 0), oldest))] * decay[index(far)]
            if widest >= 0:
                # Differences beyond the table's ends read as its ends.
                ahead = far - int64(rival[index(row), index(col)]) + half
                force *= share[index(min(max(ahead, 0), widest))]
            turn = int64(bend[index(row), index(col)])
            if turn != turned:
                turned = turn
                rows_up, cols_across = row - start_row, col - start_col
                # A point that is its own bend, as most near ones are, needs no division.
                if turn != row * cols + col:
                    turn_row = int64(index(turn) // index(cols))
                    rows_up, cols_across = turn_row - start_row, turn - turn_row * cols - start_col
                up, across = rows_up - aside_up, cols_across - aside_across
                if not as_vector:
                    into = index(sector[index(middle + rows_up), index(middle + cols_across)])
                    # The table holds the sectors as seen from the centre of the robot's point, mostly the same ones.
                    if is_aside and not _lies_between(edges, into, up, across):
                        turns = math.floor(math.atan2(up, across) * sums.size / math.tau + 0.5)
                        into = index(turns % sums.size)
                    if into != slot:
                        sums[slot] = total
                        slot, total = into, sums[into]
            if as_vector:
                # Never divides by 0: a path with a length bends on another point than the robot's.
                scale = force / math.sqrt(up * up + across * across)
                along += scale * across
                upwards += scale * up
            total += force
            if force > peak and looked[index(seen_row), index(seen_col)] < tick:
                peak, most_at = force, row * cols + col
    if as_vector:
        sums[0], sums[1], sums[2] = along, upwards, total
    else:
        sums[slot] = total
    strongest[0], source[0] = peak, most_at


# fmt: on
