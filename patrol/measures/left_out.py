"""The free ground that a fleet leaves out, because no robot sees it from where it gets.

For example, of three rooms without doors between them a fleet that starts in one leaves out two. Its coverage and MFoW
hold for the first room alone, so whoever reads them must be told. A part of less than `LEAST_M2` is a blind corner.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from patrol.ground.cspace import parts_of
from patrol.scenario.sections import VERTICES
from patrol.summary.model import LeftOut

if TYPE_CHECKING:
    from patrol.prepare import Prepared

LEAST_M2 = 1.0
"""Area of the smallest part that counts, m2."""


def left_out(prepared: Prepared) -> LeftOut | None:
    """Return the free ground that no robot of a fleet sees.

    Args:
        prepared: The scenario, its terrain and the bodies' static fields.

    Returns:
        What is left out; None where nothing is, and where vertices are patrolled in place of ground.
    """
    terrain = prepared.terrain
    unseen = terrain.free & ~prepared.patrolled
    if prepared.scenario.terrain.patrolled == VERTICES or np.count_nonzero(unseen) * terrain.point_area < LEAST_M2:
        return None
    labels, count = parts_of(unseen)
    areas_m2 = np.bincount(labels.reshape(-1), minlength=count + 1) * terrain.point_area
    areas_m2[0] = 0.0
    if areas_m2.max() < LEAST_M2:
        return None
    largest = labels == areas_m2.argmax()
    rows, columns = np.nonzero(largest)
    nearest = np.argmin((rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2)
    x, y = terrain.centre(int(rows[nearest]), int(columns[nearest]))
    narrowest = min(prepared.scenario.roster, key=lambda spec: (spec.radius, spec.number))
    fields = prepared.fields[narrowest.number]
    free_parts, _ = parts_of(terrain.free)
    reached = free_parts[fields.reach]
    if not np.isin(free_parts[largest], reached).any():
        why = "walled off, without an opening"
    elif not (largest & fields.cspace).any():
        why = f"too narrow for a body of radius {narrowest.radius:g} m, and out of sight"
    elif terrain.against.size:
        why = "behind an opening too narrow for the robots, or one-way zones leave no way back"
    else:
        why = f"behind an opening that is too narrow for a body of radius {narrowest.radius:g} m"
    counted = areas_m2 >= LEAST_M2
    return LeftOut(
        area_m2=float(areas_m2[counted].sum()),
        parts=int(np.count_nonzero(counted)),
        largest_m2=float(areas_m2.max()),
        x=round(x, 6),
        y=round(y, 6),
        why=why,
    )
