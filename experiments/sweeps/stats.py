"""Means with their uncertainty, and how near a set of numbers comes to a printed one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Estimate:
    """A mean over `count` values and its interval of confidence, None for fewer than two values."""

    mean: float
    low: float | None
    high: float | None
    count: int

    @property
    def half(self) -> float | None:
        """Half the interval's width."""
        return None if self.low is None or self.high is None else (self.high - self.low) / 2.0

    @property
    def interval(self) -> list[float] | None:
        """[low, high], or None."""
        return None if self.low is None or self.high is None else [self.low, self.high]


def estimate(values: Sequence[float], confidence: float = 0.95) -> Estimate:
    """The mean of independent values with Student's interval; ValueError without any value."""
    if not values:
        raise ValueError("no values, no mean")
    mean = math.fsum(values) / len(values)
    if len(values) == 1:
        return Estimate(mean, None, None, 1)
    from scipy.special import stdtrit  # an extra's library, and slow to load

    spread = float(np.std(values, ddof=1)) / math.sqrt(len(values))
    half = float(stdtrit(len(values) - 1, 0.5 + confidence / 2.0)) * spread
    return Estimate(mean, mean - half, mean + half, len(values))


@dataclass(frozen=True, slots=True)
class Fit:
    """How near numbers come to printed ones: median of ours / theirs, root mean square of ln(ours / theirs).

    correlation: Pearson's, of the logarithms; None where one side does not vary.
    """

    cells: int
    median_ratio: float
    rms_log_error: float
    correlation: float | None


def fit(ours: Sequence[float], theirs: Sequence[float]) -> Fit:
    """Compare positive numbers with as many positive printed ones."""
    a, b = np.log(np.asarray(ours, dtype=np.float64)), np.log(np.asarray(theirs, dtype=np.float64))
    if a.size == 0 or a.shape != b.shape:
        raise ValueError("a fit needs as many printed numbers as found ones, and at least one")
    error = a - b
    varies = a.size > 1 and float(np.ptp(a)) > 0.0 and float(np.ptp(b)) > 0.0
    return Fit(
        cells=int(a.size),
        median_ratio=math.exp(float(np.median(error))),
        rms_log_error=math.sqrt(float(np.mean(error**2))),
        correlation=float(np.corrcoef(a, b)[0, 1]) if varies else None,
    )
