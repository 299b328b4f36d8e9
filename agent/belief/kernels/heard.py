"""Kernel of shared beliefs: where the robots are that one listener has heard of."""

from __future__ import annotations

from numba import njit, types

_TABLE = types.Array(types.int64, 2, "C", readonly=True)
_PLACES = types.Array(types.int64, 2, "C")
_I = types.int64


@njit(_I(_TABLE, _TABLE, _TABLE, _TABLE, _I, _I, _I, _PLACES), cache=True, nogil=True)
def heard_places(sequence, at, x, y, row, nothing, since, places):
    """Put together where the robots are that a listener has heard since a tick.

    Args:
        sequence: int64 (m, n), of the last frame that each listener accepted of each sender.
        at: int64 (m, n), the tick at which it heard that.
        x: int64 (m, n), x of the place in it, cm.
        y: int64 (m, n), y of the place in it, cm.
        row: The listener's.
        nothing: The sequence of a sender that was not heard.
        since: The tick.
        places: int64 (n, 2), x and y in cm; the first rows are filled in, in the order of the senders.

    Returns:
        How many robots they are.
    """
    count = 0
    for column in range(sequence.shape[1]):
        if sequence[row, column] != nothing and at[row, column] >= since:
            places[count, 0] = x[row, column]
            places[count, 1] = y[row, column]
            count += 1
    return count
