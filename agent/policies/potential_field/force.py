"""The law of attraction: how hard a point pulls, by its fog and its path length (paper, Table 1 and formula (1)).

Lengths are in points of 0.1 m, whatever the size of the grid's points: in metres the paper's constants give no usable
patrol.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from patrol.kernels.elementary import exp, power
from patrol.scenario import PotentialFieldOptions

PAPER_POINT = 0.1
"""Side in m of the paper's points; alpha, beta and l refer to it."""

PAPER_AREA = 100.0 * 88.0 / 5.0
"""Patrolled ground per robot, m2, to which `reach: area` refers: the terrain `open` with five robots."""

REMEMBERED = 16
"""Tables of f by age that are kept: those of one tick, unless more robots than so many believe in different fogs."""

FloatArray = NDArray[np.float64]


def reach_scale(reach: str, area: float) -> float:
    """Return the factor by which the law of attraction reaches farther than the paper's: 1 or more.

    The paper's beta makes g4 fall to 1/e within 6.3 m, which suits its ground. Where each robot has more ground, all
    that is stale may lie too far away to differ in its pull. So `area` stretches all lengths by the root of the ratio
    of ``area`` (patrolled ground per robot, m2) to `PAPER_AREA`.
    """
    return max(1.0, math.sqrt(area / PAPER_AREA)) if reach == "area" else 1.0


def fow_force(name: str, fow: FloatArray, alpha: float) -> FloatArray:
    """Return f1 to f5 (paper, Table 1) for a fog of war from 0 to 1."""
    match name:
        case "f1":
            return fow
        case "f2":
            return fow**2
        case "f3":
            return exp(alpha * fow)
        case "f4":
            return exp(alpha * fow**2)
        case "f5":
            return exp(alpha * power(fow, 4.0))
        case _:
            raise ValueError(f"no function {name}")


def distance_force(name: str, length: FloatArray, beta: float, size: float) -> FloatArray:
    """Return g1 to g5 (paper, Table 1) for path lengths above 0, in points of 0.1 m; ``size`` is their l."""
    match name:
        case "g1":
            return 1.0 / length
        case "g2":
            return 1.0 / length**2
        case "g3":
            return exp(-size * length / beta)
        case "g4":
            return exp(-(length**2) / beta)
        case "g5":
            return exp(-power(length, 4.0) / (beta * size**2))
        case _:
            raise ValueError(f"no function {name}")


@lru_cache(maxsize=REMEMBERED)
def pull_by_age(name: str, alpha: float, mfow: int) -> FloatArray:
    """Return f by age up to ``mfow`` ticks, read-only; robots that believe in the same fog share the table."""
    return _read_only(fow_force(name, np.arange(mfow + 1, dtype=np.float64) / max(mfow, 1), alpha))


def _read_only(table: FloatArray) -> FloatArray:
    table.flags.writeable = False
    return table


class ForceLaw:
    """f and g as tables, and the horizon beyond which no point can change a decision.

    With N points, those farther than L add at most N f(1) g(L) to the force. They are left out once that is below
    ``tolerance`` times what nearer points exert. With f3 to f5, where even a fresh point exerts f(0) = 1, this bounds L
    before the fog is known. g1 and g2 fall so slowly that in practice nothing is left out.
    """

    def __init__(self, options: PotentialFieldOptions, point: float, points: int, longest: int, team: int = 1) -> None:
        """Tabulate g up to ``longest`` hundredths of a point; ``team`` counts with `reach: area` only."""
        self._options = options
        self._points = points
        unit = point / PAPER_POINT / 100.0 / reach_scale(options.reach, points * point * point / team)
        lengths = np.arange(1, longest + 1, dtype=np.float64) * unit
        decay = distance_force(options.distance, lengths, options.beta, options.length)
        # By length in hundredths of a point; 0 at length 0, because the robot's own point exerts no force.
        self.decay = np.concatenate([[0.0], decay])
        self._rising = -decay
        self.limit = longest  # length of the longest path that can matter, in hundredths of a point
        fresh, stale = fow_force(options.fow, np.array([0.0, 1.0]), options.alpha)
        self.limit = self.horizon(float(fresh) * float(decay[min(141, longest) - 1]), float(stale))
        self.decay = self.decay[: self.limit + 1].copy()
        self._rising = self._rising[: self.limit]

    def pull(self, mfow: int) -> FloatArray:
        """Return f by age up to ``mfow`` ticks, read-only."""
        return pull_by_age(self._options.fow, self._options.alpha, mfow)

    def horizon(self, exerted: float, stalest: float) -> int:
        """Return the longest path that can still matter, in hundredths of a point.

        ``exerted`` is the sum of the moduli of the forces known so far, ``stalest`` the largest value of f.
        """
        threshold = self._options.tolerance * exerted / (self._points * stalest) if stalest > 0.0 else math.inf
        return min(self.limit, int(self._rising.searchsorted(-threshold)) + 1)
