"""The gaze of a robot whose sensor sees a sector, and whose body can face elsewhere than it goes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from patrol.pose import Pose
from patrol.radio.message import as_received
from patrol.tours.cover import HEADINGS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from agent.routes.ground import Spot
    from patrol.ground.footprint import Footprint


def look_from(
    sight: Footprint,
    spot: Spot,
    point: tuple[int, int],
    tick: int,
    counted: NDArray[np.bool_],
    last_seen: NDArray[np.int32],
) -> float:
    """Return the heading, in rad, in which the ages of the points in view have the greatest sum.

    Where the robot's target, a ``point`` (row, column), is in view in some headings, it is one of them. ``counted`` and
    ``last_seen`` are bool and int32 (height, width): the points that count, and when each was seen, ticks.
    """
    views = [sight.visible(as_received(Pose(*spot, heading))) for heading in HEADINGS]
    box = views[0].box(counted.shape)
    if box is None:
        return 0.0
    top, bottom, left, right = box
    within = slice(top, bottom + 1), slice(left, right + 1)
    row0, col0 = views[0].row0, views[0].col0
    in_view = slice(top - row0, bottom + 1 - row0), slice(left - col0, right + 1 - col0)
    ages = np.where(counted[within], tick - np.maximum(last_seen[within], 0), 0)
    shown = [(view.shows(*point), int(ages[view.mask[in_view] != 0].sum())) for view in views]
    return HEADINGS[max(range(len(shown)), key=shown.__getitem__)]
