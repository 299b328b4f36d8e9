"""Assignment of robots to places with the least sum of costs."""

from __future__ import annotations

from collections.abc import Sequence


def assign(costs: Sequence[Sequence[int]]) -> list[int]:
    """Return the column of each row, all different, so that the sum of costs is least.

    Uses the Hungarian method by shortest augmenting paths, for at most as many rows as columns. Sums are exact, so all
    robots that know the same costs find the same assignment.
    """
    rows, cols = len(costs), len(costs[0]) if costs else 0
    by_row, by_col = [0] * (rows + 1), [0] * (cols + 1)
    owner, came = [0] * (cols + 1), [0] * (cols + 1)
    for row in range(1, rows + 1):
        owner[0] = row
        here = 0
        least: list[int | None] = [None] * (cols + 1)
        used = [False] * (cols + 1)
        while owner[here]:
            used[here] = True
            mine = owner[here]
            step, nearest = None, 0
            for col in range(1, cols + 1):
                if used[col]:
                    continue
                cost = costs[mine - 1][col - 1] - by_row[mine] - by_col[col]
                known = least[col]
                if known is None or cost < known:
                    least[col] = known = cost
                    came[col] = here
                if step is None or known < step:
                    step, nearest = known, col
            assert step is not None  # there are no fewer columns than rows
            for col in range(cols + 1):
                ahead = least[col]
                if used[col]:
                    by_row[owner[col]] += step
                    by_col[col] -= step
                elif ahead is not None:
                    least[col] = ahead - step
            here = nearest
        while here:
            owner[here] = owner[came[here]]
            here = came[here]
    columns = {owner[col]: col - 1 for col in range(1, cols + 1)}
    return [columns[row] for row in range(1, rows + 1)]
