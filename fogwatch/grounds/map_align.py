"""The place of one map, A, on another, B, by landmarks that both show.

The result is a rigid transform, the pose of A's frame in B's. A place (2, 0) of A with the transform (10, 5, pi / 2) is
the place (10, 7) of B. How far the walls of both then agree is counted both ways, and only where both maps are known,
so that a map of a part fits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from patrol.errors import BadInput
from patrol.ground.cspace import grown
from patrol.ground.shapes import touched_points
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.maps.cells import marked_cells
from patrol.maps.map_file import read_map_file
from patrol.pose import Pose
from ros2.wire.frames import inverted

Place = tuple[float, float]
"""x and y, m."""
Places = NDArray[np.float64]
"""(n, 2), x and y of each."""

LEAST_AGREEMENT = 0.5
"""Share of the walls that agree at least where maps lie right."""
LEAST_WALLS = 10
"""Points of wall of a map at least."""

LEAST_COMMON = 0.6
"""Share of a map's walls that counts as common at least: fewer that agree prove little."""


@dataclass(frozen=True, slots=True, eq=False)
class WallMap:
    """A map's walls."""

    walls: BoolGrid  # (h, w), occupied points beside free ones
    known: BoolGrid  # (h, w), free points and walls
    point: float  # side of a point, m
    origin: Place  # outer corner of point (0, 0), m

    def places(self, mask: BoolGrid | None = None) -> Places:
        """Return the centres of the walls, or of the points of a mask, x and y in m."""
        rows, cols = np.nonzero(self.walls if mask is None else mask)
        return np.asarray(np.stack([cols + 0.5, rows + 0.5], axis=1) * self.point + np.array(self.origin))


def wall_map(terrain: Terrain) -> WallMap:
    """Return the walls of a terrain; a map's file is read again for them.

    What a map's file leaves unknown is no wall. What lies outside of a built-in terrain is.
    """
    free, origin, point = terrain.passable, terrain.origin, terrain.point
    if terrain.source is None:
        free, origin = np.pad(free, 1), (origin[0] - point, origin[1] - point)
        occupied = ~free
    else:
        says = read_map_file(terrain.source)
        occupied = touched_points(marked_cells(says), says.resolution, point, terrain.shape)
    walls = occupied & grown(free) & ~free
    if (count := np.count_nonzero(walls)) < LEAST_WALLS:
        raise BadInput(f"{terrain.name}: shows {count} points of wall beside free ground; {LEAST_WALLS} are needed")
    return WallMap(walls, free | walls, point, origin)


def fit_landmarks(pairs: Sequence[tuple[Place, Place]]) -> tuple[Pose, list[float]]:
    """Return the transform that brings landmarks nearest to each other, by least squares.

    It is the pose of A's frame in B's; with it comes how far each landmark is off then, m. Pairs are a landmark's place
    on A and on B; two or more are needed, not all in one place.
    """
    if len(pairs) < 2:
        raise BadInput("--landmark: one says nothing of the turn; give two or more, far from each other")
    on_a, on_b = (np.array(places, dtype=np.float64) for places in zip(*pairs, strict=True))
    from_a, from_b = on_a - on_a.mean(axis=0), on_b - on_b.mean(axis=0)
    along = float((from_a * from_b).sum())
    across = float((from_a[:, 0] * from_b[:, 1] - from_a[:, 1] * from_b[:, 0]).sum())
    if math.hypot(along, across) < 1e-9:
        raise BadInput("--landmark: all are at one place, or their turn is undecided; give two far from each other")
    heading = math.atan2(across, along)
    corner = on_b.mean(axis=0) - _turn_places(on_a.mean(axis=0), heading)
    pose = Pose(float(corner[0]), float(corner[1]), heading)
    return pose, [float(off) for off in np.hypot(*(moved(on_a, pose) - on_b).T)]


def agreement(a: WallMap, b: WallMap, transform: Pose) -> float:
    """Return the share of walls that agree within a point or so, where both maps are known.

    `transform` is the pose of A's frame in B's.
    """
    hits = common = 0.0
    for source, target, pose in ((a, b, transform), (b, a, inverted(transform))):
        places = moved(source.places(), pose)
        near = grown(target.walls)
        hits += _count_marked(near, target, places)
        common += max(_count_marked(target.known | near, target, places), LEAST_COMMON * len(places))
    return hits / common


def spelled(pose: Pose) -> str:
    """Return a pose as options take it, X,Y,HEADING in m and rad."""
    return ",".join(f"{round(value, 4) + 0.0:g}" for value in (pose.x, pose.y, pose.heading))


def moved(places: Places, pose: Pose) -> Places:
    """Return places in a frame from those in a child of it, whose pose there is `pose`."""
    return np.asarray(_turn_places(places, pose.heading) + np.array((pose.x, pose.y)))


def _turn_places(places: Places, heading: float) -> Places:
    cos, sin = math.cos(heading), math.sin(heading)
    return np.asarray(places @ np.array([[cos, sin], [-sin, cos]]))


def _count_marked(mask: BoolGrid, of: WallMap, places: Places) -> float:
    """Count the places on marked points of a map."""
    cells = np.floor((places - of.origin) / of.point).astype(np.int64)
    inside = ((cells >= 0) & (cells < mask.shape[::-1])).all(axis=1)
    return float(np.count_nonzero(mask[cells[inside, 1], cells[inside, 0]]))
