"""Kernel of first bends: the last point on each path that is in sight of the start and no farther than unhindered.

Paths form a tree. It is followed from the start on, run by run as in `agent.routes.kernels.wave`, and each point is
come by once.
"""

from __future__ import annotations

from numba import njit, types

ALL_WAYS = 8
BENT = 7
BESIDE = 1
BEYOND = 3
FULL = 4
SEEN = 2
"""As in `agent.routes.kernels.wave`."""

CELLS = types.Array(types.uint32, 1, "C")
BENDS = types.Array(types.int32, 1, "C")
LISTS = types.Array(types.uint32, 2, "C")
MARK = types.Array(types.int64, 1, "C")
int64 = types.int64
index = types.uint64
"""As in `agent.routes.kernels.wave`."""


@njit(types.void(CELLS, BENDS, LISTS, MARK, int64, int64, int64), cache=True, nogil=True)
def follow(cell, bend, lists, mark, start, stride, limit):
    """Find the first bends of all paths that are at most ``limit`` long.

    For the first call of a wave, the start's bend is itself, and the last row of ``lists`` has the one entry
    start * 16 + ALL_WAYS. A later call with a larger limit continues from there, whatever bends have been found since.

    Args:
        cell: uint32, as `agent.routes.kernels.ties.decide` left it.
        bend: int32, where each path first bends; the point itself where no detour is needed. Filled in.
        lists: uint32 (5, k), see `agent.routes.kernels.wave.settle`; its last two rows are changed in place: entries at
            hand, and those that go on beyond the limit.
        mark: int64 (8,), see `agent.routes.kernels.wave.NOW`; changed in place.
        start: Flat index of the start.
        stride: Columns of the window.
        limit: Longest settled path.
    """
    start_row, start_col = start // stride, start % stride
    at_hand, beyond = lists[3], lists[4]
    room, past = lists.shape[1] - 8, (limit + 1) << 5
    count, put = mark[BEYOND], 0
    at_hand[:count] = beyond[:count]
    while count > 0 and count < room and put < room:
        count -= 1
        entry = int64(at_hand[index(count)])
        here, only = entry >> 4, entry & 15
        row = int64(index(here) // index(stride))
        for way in range(4):
            if only != ALL_WAYS and only & 3 != way:
                continue
            right, down = 1 if way % 3 == 0 else -1, 1 if way < 2 else -1
            way_across, way_up = 4 if right == 1 else 6, 5 if down == 1 else 7
            at, far, turn = here, int64(cell[index(here)]) >> 5, int64(bend[index(here)])
            up, across = row - start_row, here - row * stride - start_col
            # As in `settle`: straight runs to both sides, or the one of this way where all begin.
            first, end, straight = way + 4, 0 if only < 4 else 1, way + 4
            while count < room and put < room:
                for side in range(end):
                    straight = first if end == 1 else way_across if side == 0 else way_up
                    label = (far + 100) << 5 | straight << 2
                    if label >= past:
                        beyond[index(put)] = at << 4 | straight
                        put += 1
                        continue
                    step = (1, stride, -1, -stride)[straight & 3]
                    there = at + step
                    known = int64(cell[index(there)])
                    if known >> 2 != label >> 2:
                        continue
                    up_next = abs(up + (0, 1, 0, -1)[straight & 3])
                    across_next = abs(across + (1, 0, -1, 0)[straight & 3])
                    unhindered = 100 * abs(across_next - up_next) + 141 * min(across_next, up_next)
                    direct, bent = SEEN if far + 100 == unhindered else 0, turn
                    while known >> 2 == label >> 2:
                        bent = there if known & direct != 0 else bent
                        bend[index(there)] = bent
                        if known & BESIDE != 0:
                            at_hand[index(count)] = there << 4 | ALL_WAYS
                            count += 1
                            break
                        label += 100 << 5
                        if label >= past:
                            beyond[index(put)] = there << 4 | straight
                            put += 1
                            break
                        there += step
                        known = int64(cell[index(there)])
                if only > 3 and only < ALL_WAYS:
                    break
                end = 2
                far += 141
                if far > limit:
                    beyond[index(put)] = at << 4 | way
                    put += 1
                    break
                at += right + down * stride
                up += down
                across += right
                known = int64(cell[index(at)])
                if known >> 2 != far << 3 | way:
                    break
                if known & SEEN != 0:
                    least, most = min(abs(up), abs(across)), max(abs(up), abs(across))
                    turn = at if far == 100 * (most - least) + 141 * least else turn
                bend[index(at)] = turn
                if known & BESIDE != 0:
                    at_hand[index(count)] = at << 4 | ALL_WAYS
                    count += 1
                    break
    if max(count, put) >= room:
        mark[FULL] = 1
    mark[BEYOND], mark[BENT] = put, limit
