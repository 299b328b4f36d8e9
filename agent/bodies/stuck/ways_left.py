"""The ways left to a place, as far as a search for a manoeuvre asks for them.

A car may drive away from its place for a while, and so its search may ask for much longer ways than its own. It hardly
ever does. So ways are followed only a little farther than to the car at first, and a search that asks for a longer one
begins again with all that count.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agent.routes.path_window import FAR
from agent.routes.wave import LONGEST
from agent.routes.way_back import REACH

if TYPE_CHECKING:
    from agent.routes.ground import Ground, Spot
    from agent.routes.routes import Element
    from agent.view import View
    from patrol.ground.terrain import Terrain


class WaysLeft(NamedTuple):
    """The ways left from the points of a window. Lengths are in hundredths of a point.

    Attributes:
        length: int32 (m, n), `agent.routes.path_window.FAR` where none is known.
        row0: Row of the terrain under the window's row 0.
        col0: Column of the terrain under the window's column 0.
        known: The longest way that is known; all longer ones are not, nor those from outside of the window.
        limit: The longest way that counts; at least `known`.
        first: The way left from where the car is, m.
    """

    length: NDArray[np.int32]
    row0: int
    col0: int
    known: int
    limit: int
    first: float


def ways_left(view: View, place: Spot, margin: float, beyond: float) -> WaysLeft | None:
    """The ways left to a place.

    The longest that count are twice the direct way and a margin; where the car's own way winds more than that, its
    length and a margin.

    Args:
        view: Of this tick.
        place: x and y in m, where the car's centre may be.
        margin: m.
        beyond: How much farther than to the car ways are followed, m, as far as they count; infinity for all that do.

    Returns:
        None where no way leads from the car to the place.
    """
    pose, start, ground = view.pose, view.start, view.ground
    end = ground.join(*place)
    if end is None:
        # Robots do stand on what is closed at this tick.
        ground = ground.static
        end = ground.join(*place)
    if start is None or end is None:
        return None
    point = ground.terrain.point
    within = 2.0 * math.dist((pose.x, pose.y), place) + margin
    limit, more = _hundredths(within, point), _hundredths(beyond, point)
    up, across = abs(start[0] - end[0]), abs(start[1] - end[1])
    known = 100 * max(up, across) + 41 * min(up, across) + more
    while True:
        known = known if known < limit else limit
        found = _followed(view, ground, end, known)
        own = _at(found, start)
        if own <= known:
            break
        if known == LONGEST:
            return None
        if known == limit:
            known = limit = LONGEST
        else:
            known *= 2
    first = own * (point / 100.0)
    if limit < LONGEST and first + margin > within:
        limit = _hundredths(first + margin, point)
    if known < min(limit, own + more):
        known = min(limit, own + more)
        found = _followed(view, ground, end, known)
    if ground.terrain.point_at(pose.x, pose.y) != (start[0] - 1, start[1] - 1):
        first += math.dist(ground.centre(*start), (pose.x, pose.y))
    return WaysLeft(*found, min(known, limit), limit, first)


def ways_back(terrain: Terrain, left: NDArray[np.float64], row: int, col: int) -> WaysLeft:
    """The ways back to the reachable points, as far as any are known.

    Args:
        terrain: The map.
        left: float64 (h, w), their lengths in m (`agent.routes.way_back.WayBack.lengths`).
        row: Of the point on which the car is.
        col: Of the point on which the car is.
    """
    span = math.ceil(REACH / terrain.point)
    top, side = max(0, row - span), max(0, col - span)
    part = left[top : row + span + 1, side : col + span + 1]
    lengths = np.full(part.shape, FAR, dtype=np.int32)
    finite = np.isfinite(part)
    lengths[finite] = np.rint(part[finite] / (terrain.point / 100.0))
    return WaysLeft(lengths, top, side, LONGEST, LONGEST, float(left[row, col]))


def _hundredths(length: float, point: float) -> int:
    """A length in m in hundredths of a point."""
    return round(min(LONGEST, 100.0 * length / point))


def _followed(view: View, ground: Ground, end: Element, known: int) -> tuple[NDArray[np.int32], int, int]:
    """Lengths of the ways to an element, in hundredths of a point, and the terrain's row and column under them."""
    window = view.routes.window(-(-known // 100) + 1)
    lengths = window.lengths_from(ground, *end, [end], known)
    return lengths, window.row0, window.col0


def _at(found: tuple[NDArray[np.int32], int, int], element: Element) -> int:
    """The length of the way from an element, `agent.routes.path_window.FAR` where none is known."""
    lengths, row0, col0 = found
    row, col = element[0] - 1 - row0, element[1] - 1 - col0
    inside = 0 <= row < lengths.shape[0] and 0 <= col < lengths.shape[1]
    return int(lengths[row, col]) if inside else FAR
