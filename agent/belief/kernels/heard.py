"""Kernel of shared beliefs: where the robots are that one listener has heard of."""

from __future__ import annotations

from numba import njit, types

_TABLE = types.Array(types.int64, 2, "C", readonly=True)
_PLACES = types.Array(types.float64, 2, "C")
_I = types.int64
_F = types.float64


@njit(_I(_TABLE, _TABLE, _TABLE, _TABLE, _I, _I, _I, _F, _PLACES), cache=True, nogil=True)
def heard_places(sequence, at, x, y, row, nothing, since, per_m, places):
    """Put together where the robots are that a listener has heard since a tick.

    Args:
        sequence: int64 (m, n), of the last frame that each listener accepted of each sender.
        at: int64 (m, n), the tick at which it heard that.
        x: int64 (m, n), x of the place in it, cm.
        y: int64 (m, n), y of the place in it, cm.
        row: The listener's.
        nothing: The sequence of a sender that was not heard.
        since: The tick.
        per_m: cm in a metre.
        places: float64 (n, 2), x and y in m; the first rows are filled in, in the order of the senders.

    Returns:
        How many robots they are.
    """
    count = 0
    said, said_at, xs, ys = sequence[row], at[row], x[row], y[row]
    for column in range(said.size):
        if said[column] != nothing and said_at[column] >= since:
            places[count, 0] = xs[column] / per_m
            places[count, 1] = ys[column] / per_m
            count += 1
    return count
