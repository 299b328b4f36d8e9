"""A test that chance explains a count, at a rate of false alarms that holds whenever counting stops.

n draws that each hit with probability p, of which x hit, are compared with draws of an unknown probability q, weighed
over all q by a Beta(1/2, 1/2) distribution:

    E = integral of q^x (1 - q)^(n - x) dBeta(q)  /  (p^x (1 - p)^(n - x))

As long as each draw's chance is p whatever came before, E is a martingale that begins at 1, so the probability that it
ever reaches 1 / a is at most a (Ville's inequality; Robbins, "Statistical methods related to the law of the iterated
logarithm", 1970). That holds for any rule of when to count and when to stop that does not look ahead: the number of
frames on a link may depend on earlier losses, which an exact binomial test rules out. The price is small: at 1e-9
about seven standard deviations are needed instead of six.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

FAMILY = 1e-9
"""The probability of any false alarm in all of a run's statistical checks together."""


def evidence(hits: int, draws: int, p: float) -> float:
    """Return ln E, with E as in the module's docstring; infinite where p excludes the hits."""
    if (p <= 0.0 and hits) or (p >= 1.0 and hits < draws):
        return math.inf
    under = 0.0
    if hits:
        under += hits * math.log(p)
    if draws - hits:
        # Exact also where p is tiny.
        under += (draws - hits) * math.log1p(-p)
    return _log_beta(hits + 0.5, draws - hits + 0.5) - _log_beta(0.5, 0.5) - under


def enough(draws: int, p: float, alarm: float) -> bool:
    """Return True if there are enough draws that some number of hits would be unexplained.

    For example, at 1e-9 and p = 0.3, 100 draws are enough; at p = 0.5, 3 draws are not.
    """
    # No count is less likely than one of these two.
    return max(evidence(0, draws, p), evidence(draws, draws, p)) >= -math.log(alarm)


def unexplained(hits: int, draws: int, p: float, alarm: float) -> bool:
    """Return True if chance does not explain a number of hits; `alarm` bounds a false alarm's probability.

    For example, at 1e-9 and p = 0.3, chance explains 60 hits of 100 draws, but not 90.
    """
    return evidence(hits, draws, p) >= -math.log(alarm)


@dataclass(slots=True)
class Series:
    """Draws that each hit with probability `p`, and the words for how many hit and how many should have.

    For example, "f1: {hits} of {draws} frames were lost" and ", 50 % configured".
    """

    p: float
    words: str
    expected: str
    draws: int = 0
    hits: int = 0

    def add(self, hit: bool) -> None:
        """Count one draw."""
        self.draws += 1
        self.hits += hit

    def found(self) -> str:
        """Say how many draws have hit."""
        return self.words.format(hits=self.hits, draws=self.draws)

    def is_told(self, alarm: float) -> bool:
        """Return True if there are enough draws to judge by."""
        return enough(self.draws, self.p, alarm)

    def problem(self, alarm: float) -> str:
        """Say that chance does not explain the hits; empty where it does, or there are too few draws."""
        if self.is_told(alarm) and unexplained(self.hits, self.draws, self.p, alarm):
            return self.found() + self.expected
        return ""


def first_problem(series: Iterable[Series], alarm: float) -> str:
    """Return the first problem of some series, empty where chance explains all of them."""
    return next(filter(None, (entry.problem(alarm) for entry in series)), "")


def _log_beta(a: float, b: float) -> float:
    return math.lgamma(a) + math.lgamma(b) - math.lgamma(a + b)
