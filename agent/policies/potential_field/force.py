"""The law of attraction: how hard a point pulls, by its fog and by the way to it (paper, Table 1 and formula (1)).

Lengths are in points of 0.1 m, whatever the grid's point is: with metres the paper's constants do not patrol at all.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from patrol.scenario import PatrolSpec

PAPER_POINT = 0.1
"""Side in m of the paper's points, in which alpha, beta and l are given."""

FloatArray = NDArray[np.float64]


def fow_force(name: str, fow: FloatArray, alpha: float) -> FloatArray:
    """f1 to f5 of the normalised fog of war in [0, 1]."""
    match name:
        case "f1":
            return fow
        case "f2":
            return fow**2
        case "f3":
            return np.exp(alpha * fow)
        case "f4":
            return np.exp(alpha * fow**2)
        case "f5":
            return np.exp(alpha * fow**4)
        case _:
            raise ValueError(f"no function {name}")


def distance_force(name: str, length: FloatArray, beta: float, size: float) -> FloatArray:
    """g1 to g5 of path lengths above 0 in points of 0.1 m; ``size`` is the l of g3 and g5."""
    match name:
        case "g1":
            return 1.0 / length
        case "g2":
            return 1.0 / length**2
        case "g3":
            return np.exp(-size * length / beta)
        case "g4":
            return np.exp(-(length**2) / beta)
        case "g5":
            return np.exp(-(length**4) / (beta * size**2))
        case _:
            raise ValueError(f"no function {name}")


class ForceLaw:
    """f and g as tables, and the horizon beyond which no point can change a decision.

    With N points, all that is farther than L adds at most N f(1) g(L) to the force. Once that is below ``tolerance``
    times what nearer points exert, it is left out; with f3 to f5, where even a fresh point exerts f(0) = 1, this
    bounds L before anything is known of the fog. g1 and g2 fall so slowly that in practice nothing is left out.

    limit: longest path that can matter, in hundredths of a point. decay: float64 (limit + 1,), g by length in
    hundredths of a point; 0 at length 0, for the robot's own point exerts no force.
    """

    def __init__(self, patrol: PatrolSpec, point: float, points: int, longest: int) -> None:
        """Tabulate.

        point: m. points: N. longest: hundredths of a point, beyond which no path is followed in any case.
        """
        self._patrol = patrol
        self._points = points
        unit = point / PAPER_POINT / 100.0
        lengths = np.arange(1, longest + 1, dtype=np.float64) * unit
        decay = distance_force(patrol.distance, lengths, patrol.beta, patrol.length)
        self.decay = np.concatenate([[0.0], decay])
        self._rising = -decay
        self.limit = longest
        fresh, stale = fow_force(patrol.fow, np.array([0.0, 1.0]), patrol.alpha)
        self.limit = self.horizon(float(fresh) * float(decay[min(141, longest) - 1]), float(stale))
        self.decay = self.decay[: self.limit + 1].copy()
        self._rising = self._rising[: self.limit]

    def pull(self, mfow: int) -> FloatArray:
        """f by age in ticks, float64 (mfow + 1,), when the stalest point's age is ``mfow`` ticks."""
        fow = np.arange(mfow + 1, dtype=np.float64) / max(mfow, 1)
        return fow_force(self._patrol.fow, fow, self._patrol.alpha)

    def horizon(self, exerted: float, stalest: float) -> int:
        """Longest path that can still matter, in hundredths of a point.

        exerted: sum of the moduli of the forces known so far. stalest: the largest f there is.
        """
        threshold = self._patrol.tolerance * exerted / (self._points * stalest) if stalest > 0.0 else math.inf
        return min(self.limit, int(np.searchsorted(self._rising, -threshold)) + 1)
