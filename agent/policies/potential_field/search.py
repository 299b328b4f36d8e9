"""What the search for the point that pulls hardest works with."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from agent.routes.path_window import PathWindow
    from agent.routes.routes import Element

NO_RIVALS = np.zeros((0, 0), dtype=np.int32)
"""The lengths of rivals' paths where there are no rivals."""


class Law(NamedTuple):
    """How hard points pull, along the paths of a window.

    Attributes:
        pull: As log_pull of `agent.policies.potential_field.kernels.hardest.hardest`.
        decay: As its log_decay.
        rival: As there; `NO_RIVALS` without any.
        beyond: The hardest that a point without a known path could pull.
        part: First and end row, first and end column of the window's part that holds all known paths.
    """

    pull: NDArray[np.float64]
    decay: NDArray[np.float64]
    rival: NDArray[np.int32]
    beyond: float
    part: tuple[int, int, int, int]


def least_way(one: Element, other: Element) -> int:
    """The length of the way between two elements if nothing is in between.

    Args:
        one: Row and column.
        other: Row and column.

    Returns:
        Hundredths of a point: 141 for a diagonal step, 100 for any other.
    """
    up, across = abs(one[0] - other[0]), abs(one[1] - other[1])
    return 100 * max(up, across) + 41 * min(up, across)


def part_within(paths: PathWindow, start: Element, limit: int) -> tuple[int, int, int, int]:
    """The part of a window that paths of a length can lead to.

    Args:
        paths: The window.
        start: Where the paths begin, row and column of the ground.
        limit: In hundredths of a point.

    Returns:
        First and end row, first and end column of the window; ends are exclusive.
    """
    (rows, cols), span = paths.state.shape, limit // 100
    row, col = start[0] - 1 - paths.row0, start[1] - 1 - paths.col0
    return max(0, row - span), min(rows, row + span + 1), max(0, col - span), min(cols, col + span + 1)
