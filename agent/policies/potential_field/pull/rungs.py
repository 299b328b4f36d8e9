"""How far a robot follows paths until nothing farther away can change which way it goes.

Forces are summed along paths up to one of a few lengths, the rungs. Of all that lies beyond each rung, bounds of the
sum and of the greatest force are known before any path is. Sums only grow. So where the bounds neither put another
sector before the strongest one nor exceed the greatest force so far, the rest can be left out. The sum of all forces
ends at the horizon. A rung beyond the horizon would hold forces that this sum lacks, so it is not used.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.policies.potential_field.kernels.beyond import beyond

if TYPE_CHECKING:
    from agent.belief.dilated import Blocks

COUNT = 17
"""Number of rungs."""

RATIO = 1.1
"""Of one rung's length to the one before."""

STRIDE = 3
"""Rungs to go on by where nothing says which one will do."""

EARLY = 0.25
"""A rung is chosen beforehand if the bound of the rest is below this share of the lead of the strongest sector, which
may shrink."""

ROUNDING = 1e-7
"""No sum of fewer than 2^28 forces is off by a larger share of itself, in whatever order it is taken."""

FloatArray = NDArray[np.float64]


class Rungs:
    """The rungs of one robot, and which of them is likely to do.

    Attributes:
        lengths: int64 (k,), ascending, in hundredths of a point; there may be none.
    """

    def __init__(self, first: int, least: int, limit: int, *, straight: bool = False) -> None:
        """Find the rungs.

        Args:
            first: The first one, in hundredths of a point, unless it is too short.
            least: Shortest one to be used.
            limit: Upper bound, exclusive.
            straight: Whether paths are straight lines, through obstacles.
        """
        lengths = [round(first * RATIO**rung) for rung in range(COUNT)]
        self.lengths = np.array([length for length in lengths if least <= length < limit], dtype=np.int64)
        self._bounds = np.zeros((2, self.lengths.size))
        self._likely = 0
        self._straight = straight

    def begin(self, blocks: Blocks, row: int, col: int, tick: int, by_age: FloatArray, decay: FloatArray) -> int:
        """Bound what lies beyond each rung.

        Args:
            blocks: How old the points can be at most.
            row: The robot's row in the terrain.
            col: The robot's column in the terrain.
            tick: Now.
            by_age: float64, f by age in ticks.
            decay: float64, g by length in hundredths of a point.

        Returns:
            The rung to begin with, which did at the last tick.
        """
        beyond(*blocks, row, col, tick, self._straight, by_age, decay, self.lengths, self._bounds)
        return self._likely

    def sure(self, rung: int, sums: FloatArray, strongest: float) -> int:
        """How many sectors, strongest first, are sure to come before all others.

        Args:
            rung: Up to which forces were summed.
            sums: float64 (sectors,), the sums.
            strongest: The greatest force so far.

        Returns:
            Their number; 0 also where a greater force may be farther away.
        """
        if strongest <= self._bounds[1, rung]:
            return 0
        leads = _leads(sums)
        # A sector that all the rest goes to, against one that gets nothing of it.
        rest = self._bounds.item(0, rung) * (1.0 + ROUNDING)
        sure = next((place for place, lead in enumerate(leads) if not lead > rest), len(leads))
        if sure:
            self._likely = self._first_to_do(0, leads[0], strongest, rung)
        return sure

    def after(self, rung: int, sums: FloatArray, strongest: float) -> int:
        """The rung to go on to from one that did not do.

        Args:
            rung: As of `sure`.
            sums: As of `sure`.
            strongest: As of `sure`.

        Returns:
            A later one; the number of rungs where none is left.
        """
        left = self.lengths.size
        self._likely = min(self._first_to_do(rung + 1, _leads(sums)[0], strongest, rung + STRIDE), left - 1)
        return self._likely if self._likely > rung else left

    def keep_within(self, longest: int) -> None:
        """Begin the next time with a rung no longer than this.

        Args:
            longest: In hundredths of a point.
        """
        within = int(np.searchsorted(self.lengths, longest, side="right"))
        self._likely = max(0, min(self._likely, within - 1))

    def _first_to_do(self, first: int, lead: float, strongest: float, otherwise: int) -> int:
        """The first rung, of ``first`` and later ones, that is likely to do.

        Args:
            first: See above.
            lead: Of the strongest sector.
            strongest: The greatest force so far.
            otherwise: What to return where none is.
        """
        for rung, (total, most) in enumerate(self._bounds[:, first:].T.tolist(), start=first):
            if total < EARLY * lead and most < strongest:
                return rung
        return otherwise


def _leads(sums: FloatArray) -> list[float]:
    """By how much each sector is stronger than the next weaker one, strongest first, after all rounding."""
    ranked = sorted(sums.tolist(), reverse=True)
    return [force * (1.0 - ROUNDING) - weaker * (1.0 + ROUNDING) for force, weaker in pairwise([*ranked, 0.0])]
