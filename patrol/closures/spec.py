"""The scenario's closures: doors and boxes, ground that is closed at times.

    closures:
      - {name: gate, polygon: [[2, 2], [3, 2], [3, 4], [2, 4]], closed: [[600, 900], [1800, 2400]]}
      - {name: door, polygon: [[8, 2], [9, 2], [9, 3], [8, 3]], closes: 0.002, opens: 0.01}
      - {name: crate, polygon: [[5, 5], [6, 5], [6, 6], [5, 6]]}

While a closure is closed, no body may enter it and no sensor sees into it or through it. One without times and rates is
open unless a fault of kind `close` closes it, which operators give too.
"""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from patrol.areas import MOST_TIMES, Span, check_spans, has_area, listed_in_file
from patrol.ground.marks import Look, Mark, Moment, mark_ground
from patrol.ground.shapes import cover
from patrol.ground.terrain import Terrain
from patrol.values import Name, Polygon, Positive, Section, at_least, at_most, wrong

MOST_CLOSURES = 256

Times = Annotated[tuple[Span, ...], at_least(1, "spans [from, to]"), at_most(MOST_TIMES, "spans")]


class ClosureSpec(Section):
    """A closure: where it is, and when it is closed."""

    EXAMPLE = "{name: door, polygon: [[8, 2], [9, 2], [9, 3]], closed: [[60, 90]]}"

    name: Name = Field(description="the closure's name")
    polygon: Polygon = Field(description="m, [[x, y], ...]")
    closed: Times | None = Field(None, description="s, [[from, to], ...] in which it is closed")
    closes: Positive | None = Field(None, description="times per second at which it closes while open, at random")
    opens: Positive | None = Field(None, description="times per second at which it opens while closed, at random")

    @model_validator(mode="after")
    def _closes_in_one_way_at_most(self) -> Self:
        if not has_area(self.polygon):
            raise wrong("polygon", f"{self.name}: its corners lie on one line, so it has no area; correct them")
        by_rates = self.closes is not None or self.opens is not None
        if by_rates and self.closed is not None:
            raise wrong("closed", f"{self.name}: closes by rates already; drop closed, or closes and opens")
        if by_rates and (self.closes is None or self.opens is None):
            missing = "closes" if self.closes is None else "opens"
            raise wrong(missing, f"{self.name}: is missing beside the other rate; give it, per second")
        check_spans(self.closed or (), "closed", self.name)
        return self

    def mark(self, terrain: Terrain, number: int) -> Mark | None:
        """Return the closure's outline."""
        del number
        points = np.zeros(terrain.shape, dtype=np.bool_)
        points.reshape(-1)[closure_points(self, terrain)] = True
        return mark_ground("closure", self.name, self.name, points, terrain, closes=True)

    def look(self, moment: Moment) -> Look:
        """Return what its mark looks like at a moment."""
        filled, waits = self.name in moment.closed, self.name in moment.waiting
        return Look(f"{self.name} waits" if waits else self.name, filled or waits, filled, waits)


Closures = Annotated[
    tuple[ClosureSpec, ...],
    at_most(MOST_CLOSURES, "closures"),
    listed_in_file("closures", "{name: door, polygon: ..., closed: [[60, 90]]}"),
]


def closure_points(closure: ClosureSpec, terrain: Terrain) -> NDArray[np.int64]:
    """Return the passable points that share some area with a closure, as ascending flat indices.

    Nothing may be closed on the terrain.
    """
    covered = cover(closure.polygon, terrain.shape, terrain.point, terrain.origin)
    return np.flatnonzero(covered & terrain.passable)
