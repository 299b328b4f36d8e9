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
    """Return the factor by which the law of attraction reaches farther than the paper's.

    The paper's beta makes g4 fall to 1/e within 6.3 m, which suits its ground. Where each robot has more ground, all
    that is stale may lie too far away to differ in its pull. So `area` stretches all lengths by the root of the ratio.

    Args:
        reach: ``paper`` or ``area`` (`patrol.options.reach`).
        area: Patrolled ground per robot, m2.

    Returns:
        1 for ``paper`` and on ground no larger than the reference, `PAPER_AREA`; more on larger ground.
    """
    return max(1.0, math.sqrt(area / PAPER_AREA)) if reach == "area" else 1.0


def fow_force(name: str, fow: FloatArray, alpha: float) -> FloatArray:
    """f1 to f5 (paper, Table 1).

    Args:
        name: ``f1`` to ``f5``.
        fow: Normalised fog of war in [0, 1].
        alpha: The exponent's factor in f3 to f5.

    Raises:
        ValueError: There is no such function.
    """
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
    """g1 to g5 (paper, Table 1).

    Args:
        name: ``g1`` to ``g5``.
        length: Path lengths above 0, in points of 0.1 m.
        beta: The exponent's divisor in g3 to g5.
        size: l of g3 and g5.

    Raises:
        ValueError: There is no such function.
    """
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
    """f by age; robots that believe in the same fog share the table.

    Args:
        name: ``f1`` to ``f5``.
        alpha: The exponent's factor in f3 to f5.
        mfow: Age of the stalest point, ticks.

    Returns:
        float64 (mfow + 1,), indexed by age in ticks; read-only.
    """
    return _read_only(fow_force(name, np.arange(mfow + 1, dtype=np.float64) / max(mfow, 1), alpha))


def _read_only(table: FloatArray) -> FloatArray:
    table.flags.writeable = False
    return table


class ForceLaw:
    """f and g as tables, and the horizon beyond which no point can change a decision.

    With N points, those farther than L add at most N f(1) g(L) to the force. They are left out once that is below
    ``tolerance`` times what nearer points exert. With f3 to f5, where even a fresh point exerts f(0) = 1, this bounds L
    before the fog is known. g1 and g2 fall so slowly that in practice nothing is left out.

    Attributes:
        limit: Longest path that can matter, in hundredths of a point.
        decay: float64 (limit + 1,), g by length in hundredths of a point; 0 at length 0, because the robot's own point
            exerts no force.
    """

    def __init__(self, options: PotentialFieldOptions, point: float, points: int, longest: int, team: int = 1) -> None:
        """Tabulate g.

        Args:
            options: The policy's, with the functions' names and constants.
            point: Side of the terrain's points, m.
            points: N.
            longest: Upper bound of the path length in any case, in hundredths of a point.
            team: Number of robots that share the points; it counts with `reach: area` only.
        """
        self._options = options
        self._points = points
        unit = point / PAPER_POINT / 100.0 / reach_scale(options.reach, points * point * point / team)
        lengths = np.arange(1, longest + 1, dtype=np.float64) * unit
        decay = distance_force(options.distance, lengths, options.beta, options.length)
        self.decay = np.concatenate([[0.0], decay])
        self._rising = -decay
        self.limit = longest
        fresh, stale = fow_force(options.fow, np.array([0.0, 1.0]), options.alpha)
        self.limit = self.horizon(float(fresh) * float(decay[min(141, longest) - 1]), float(stale))
        self.decay = self.decay[: self.limit + 1].copy()
        self._rising = self._rising[: self.limit]

    def pull(self, mfow: int) -> FloatArray:
        """f by age.

        Args:
            mfow: Age of the stalest point, ticks.

        Returns:
            float64 (mfow + 1,), indexed by age in ticks; read-only.
        """
        return pull_by_age(self._options.fow, self._options.alpha, mfow)

    def horizon(self, exerted: float, stalest: float) -> int:
        """Return the longest path that can still matter.

        Args:
            exerted: Sum of the moduli of the forces known so far.
            stalest: Largest value of f.

        Returns:
            Length in hundredths of a point.
        """
        threshold = self._options.tolerance * exerted / (self._points * stalest) if stalest > 0.0 else math.inf
        return min(self.limit, int(self._rising.searchsorted(-threshold)) + 1)
