"""Means with confidence intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec

from patrol.errors import BadInput


def check_installed() -> None:
    """Check that intervals can be computed, before runs of hours."""
    if find_spec("scipy") is None:
        remedy = "install it with: pip install 'fogwatch[experiments]' (in a checkout: make develop)"
        raise BadInput(f"means and intervals need scipy; {remedy}")


@dataclass(frozen=True, slots=True)
class Estimate:
    """A mean with its confidence interval."""

    mean: float
    low: float | None  # lower end of the interval; None for fewer than two values
    high: float | None  # upper end; None for fewer than two values
    count: int  # number of values
    p: float | None = None  # of a two-sided t-test that the mean is 0; None for fewer than two values, or equal ones

    @property
    def half(self) -> float | None:
        """Half the width of the interval, or None."""
        return None if self.low is None or self.high is None else (self.high - self.low) / 2.0


def with_interval(found: Estimate | None, digits: int = 1, sign: str = " ±", none: str = "-") -> str:
    """Return a mean and half the width of its 95 % interval, as in "12.3 ±0.4", or `none` for None."""
    if found is None:
        return none
    return f"{found.mean:.{digits}f}" + ("" if found.half is None else f"{sign}{found.half:.{digits}f}")


def estimate(values: Sequence[float], confidence: float = 0.95) -> Estimate:
    """Return the mean of independent values with Student's interval and test."""
    if not values:
        raise ValueError("a mean needs at least one value")
    mean = math.fsum(values) / len(values)
    if len(values) == 1:
        return Estimate(mean, None, None, 1)
    from scipy.special import stdtr, stdtrit  # an optional dependency, and slow to load

    free = len(values) - 1
    spread = math.sqrt(math.fsum((value - mean) ** 2 for value in values) / free / len(values))
    half = float(stdtrit(free, 0.5 + confidence / 2.0)) * spread
    p = None if spread == 0.0 else 2.0 * float(stdtr(free, -abs(mean) / spread))
    return Estimate(mean, mean - half, mean + half, len(values), p)
