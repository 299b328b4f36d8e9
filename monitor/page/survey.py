"""Figures of a whole fog: its stalest point, and the share of the ground that has been seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from monitor.page.kernels.survey import stalest
from patrol.ground.fog import NEVER


@dataclass(frozen=True, slots=True)
class Survey:
    """A fog at one tick.

    Attributes:
        row: Row of the stalest patrolled point; of several, the one nearest to their centre.
        col: Its column.
        age: Its age, ticks; a point that was never seen counts from tick 0.
        ever_seen: Whether it was ever seen.
        seen_share: The share of patrolled points that were seen, from 0 to 1.
    """

    row: int
    col: int
    age: int
    ever_seen: bool
    seen_share: float


def survey_of(last_seen: NDArray[np.int32], patrolled: NDArray[np.bool_], tick: int) -> Survey | None:
    """Survey a fog.

    Args:
        last_seen: int32 (h, w), ticks, with `patrol.ground.fog.NEVER`.
        patrolled: bool (h, w), the points that count.
        tick: The tick of the fog.

    Returns:
        The survey; None if no point counts.
    """
    row, col, seen, points = stalest(last_seen, patrolled.view(np.uint8))
    if points == 0:
        return None
    last = int(last_seen[row, col])
    return Survey(int(row), int(col), tick - max(last, 0), last != NEVER, seen / points)
