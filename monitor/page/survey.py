"""Figures of a whole fog: its stalest point, and the share of the ground that has been seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from monitor.kernels.survey import stalest
from patrol.ground.fog import NEVER


@dataclass(frozen=True, slots=True)
class Survey:
    """A fog at one tick."""

    row: int  # of the stalest patrolled point; of several, the one nearest to their centre
    col: int  # of the same point
    age: int  # of that point, ticks; from tick 0 if it was never seen
    ever_seen: bool  # that point was seen at least once
    seen_share: float  # of the patrolled points, from 0 to 1


def survey_of(last_seen: NDArray[np.int32], patrolled: NDArray[np.bool_], tick: int) -> Survey | None:
    """Survey a fog at a tick; return None if no point counts.

    `last_seen` has ticks and `patrol.ground.fog.NEVER`, `patrolled` the points that count, both (h, w).
    """
    row, col, seen_points, points = stalest(last_seen, patrolled.view(np.uint8))
    if points == 0:
        return None
    last = int(last_seen[row, col])
    return Survey(int(row), int(col), tick - max(last, 0), last != NEVER, seen_points / points)
