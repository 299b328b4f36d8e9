"""The free ground that a fleet leaves out, because no robot sees it from where it gets.

For example, of three rooms without doors between them a fleet that starts in one leaves out two. Its coverage and MFoW
hold for the first room alone, and reading them needs to know that. A part of less than `LEAST_M2` may be a blind
corner, so small parts do not count where all of them together are little.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from patrol.ground.cspace import parts_of
from patrol.ground.fields import StaticFields
from patrol.ground.marks import middle
from patrol.ground.terrain import BoolGrid, Terrain

LEAST_M2 = 1.0
"""Area from which on a part counts by itself, and from which on all smaller parts together do, m2."""

LEAST_SHARE = 0.01
"""Share of the free ground from which on the smaller parts together count too."""


@dataclass(frozen=True, slots=True)
class LeftOut:
    """Free ground that no robot of a fleet sees."""

    area_m2: float  # of all parts that count
    parts: int  # the number of these parts
    largest_m2: float
    x: float  # east coordinate of a place in the largest, m
    y: float  # north coordinate of the place, m
    why: str  # the reason why no robot sees the largest
    small_parts: int = 0  # the number of these parts that are smaller than `LEAST_M2`

    @property
    def text(self) -> str:
        """The same in words, such as "23 m² of free ground in 2 parts, which no robot sees; the largest, ..."."""
        parts = "" if self.parts == 1 else f" in {self.parts} parts"
        if self.parts > 1 and self.small_parts:
            small = "each" if self.small_parts == self.parts else f"{self.small_parts} of them"
            parts += f", {small} of less than {LEAST_M2:g} m²"
        largest = "it is" if self.parts == 1 else f"the largest, {_area_text(self.largest_m2)}, is"
        return (
            f"{_area_text(self.area_m2)} of free ground{parts}, which no robot sees; {largest} around ({self.x:.2f}, "
            f"{self.y:.2f}), {self.why}"
        )


def left_out(terrain: Terrain, patrolled: BoolGrid, narrowest: StaticFields, radius: float) -> LeftOut | None:
    """Return the free ground that no robot of a fleet sees; None where there is none that counts.

    The fields and the radius are those of the fleet's narrowest body.
    """
    unseen = terrain.free & ~patrolled
    least_m2 = min(LEAST_M2, LEAST_SHARE * np.count_nonzero(terrain.free) * terrain.point_area)
    if np.count_nonzero(unseen) * terrain.point_area < least_m2:
        return None
    labels, count = parts_of(unseen)
    areas_m2 = np.bincount(labels.reshape(-1), minlength=count + 1) * terrain.point_area
    # Label 0 is the ground that is seen.
    areas_m2[0] = 0.0
    small = (areas_m2 > 0.0) & (areas_m2 < LEAST_M2)
    if areas_m2[small].sum() < least_m2:
        # Too little in all: crumbs behind corners.
        small[:] = False
    counted = (areas_m2 >= LEAST_M2) | small
    if not counted.any():
        return None
    largest = labels == areas_m2.argmax()
    x, y = middle(largest, terrain)
    return LeftOut(
        area_m2=round(float(areas_m2[counted].sum()), 6),
        parts=int(np.count_nonzero(counted)),
        largest_m2=round(float(areas_m2.max()), 6),
        x=round(x, 6),
        y=round(y, 6),
        why=why_out_of_reach(largest, joined_ground(terrain, narrowest.reach), narrowest.cspace, radius),
        small_parts=int(np.count_nonzero(small)),
    )


def _area_text(area_m2: float) -> str:
    return f"{area_m2:.0f} m²" if area_m2 >= LEAST_M2 else f"{area_m2:.2g} m²"


def joined_ground(terrain: Terrain, reach: BoolGrid) -> BoolGrid:
    """Return the free ground that is connected with where a body gets to, however narrow the way."""
    labels, _ = parts_of(terrain.free)
    return np.isin(labels, np.unique(labels[reach]))


def why_out_of_reach(part: BoolGrid, joined: BoolGrid, cspace: BoolGrid, radius: float) -> str:
    """Return the reason why a body does not get into a part of the free ground."""
    if not (part & joined).any():
        return "walled off, without an opening"
    if not (part & cspace).any():
        return f"too narrow for a body of radius {radius:g} m"
    return f"behind an opening that is too narrow for a body of radius {radius:g} m"
