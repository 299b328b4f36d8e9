"""Places and times by their definitions, for checks that must not ask the grid."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def is_within(spans: Sequence[tuple[float, float]], time_s: float) -> bool:
    """Return True if one of the spans of time has begun and not ended.

    For example, with spans from 10 to 20 s and from 30 to 40 s, True at 10 s and False at 20 s.
    """
    return sum(first <= time_s for first, _ in spans) > sum(end <= time_s for _, end in spans)


def is_inside(corners: NDArray[np.float64], x: float, y: float) -> bool:
    """Return True for a place inside a polygon, by the even-odd rule.

    `corners` is float64 (n, 2): x and y of each corner, m.
    """
    xs, ys = corners.T
    to_xs, to_ys = np.roll(xs, -1), np.roll(ys, -1)
    # A ray to the right crosses sides; half open, so that a corner counts for one of its two sides.
    crossed = (ys > y) != (to_ys > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        right = x < xs + (y - ys) * (to_xs - xs) / (to_ys - ys)
    return bool(np.count_nonzero(crossed & right) % 2)
