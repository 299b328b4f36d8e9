"""The place of one map, A, on another, B: by landmarks that both show, or by laying their walls on each other.

The result is a rigid transform, the pose of A's frame in B's. A place (2, 0) of A with the transform (10, 5, pi / 2) is
the place (10, 7) of B.

Walls are laid on each other in three steps. First at a coarse grid: for each of some hundred turns of A, a Fourier
transform gives the agreement of all shifts at once. Then the best places are moved until A's walls lie nearest to B's.
Last, their agreement is counted at the maps' own points. Agreement is counted both ways, and only where both maps are
known, so that a map of a part fits; but where little is common, little agreement is left. A place is accepted only if
no other agrees nearly as well: a symmetric building fits in several ways, and guessing would send robots into walls.
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
from ros2.wire.frames import composed, inverted

Place = tuple[float, float]
"""x and y, m."""
Places = NDArray[np.float64]
"""(n, 2), x and y of each."""

LEAST_AGREEMENT = 0.5
"""Share of the walls that must agree where maps lie on each other."""
LEAST_LEAD = 0.1
"""By how much the best place must agree better than every other one."""
LEAST_WALLS = 10
"""Points of wall of a map at least."""

LEAST_COMMON = 0.6
"""Share of a map's walls that counts as common at least: fewer that agree prove little."""

_COARSE = 96
"""Cells of the coarse grid along the longer map."""
_PEAKS = 3
"""Places that are noted for each turn."""
_TRIED = 16
"""Places that are looked at closely."""
_MOST_WALLS = 3000
"""Points of walls that are moved at most."""
_APART = 2.5
"""Cells of the coarse grid between places that count as different."""


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


@dataclass(frozen=True, slots=True)
class Alignment:
    """A place of A on B."""

    transform: Pose  # pose of A's frame in B's
    agreement: float  # share of the walls that agree, 0 to 1


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


def align_maps(a: WallMap, b: WallMap) -> list[Alignment]:
    """Return the places of A on B, the best first; points of both must be of the same size."""
    walls = a.places()
    centre = 0.5 * (walls.min(axis=0) + walls.max(axis=0))
    radius = float(np.hypot(*(walls - centre).T).max())
    longest = max(2.0 * radius, *(b.point * side for side in b.walls.shape))
    cell = max(a.point, longest / _COARSE)
    far = _Nearness(b, math.ceil(1.5 * cell / b.point))
    close = _Nearness(b, 3)
    some = walls[:: max(1, len(walls) // _MOST_WALLS)] - centre
    alignments: list[Alignment] = []
    for pose in _coarse_poses(a, centre, b, cell, radius):
        fitted = _settle_pose(some, far, pose, cell, 0.5 * b.point, radius)
        fitted = _settle_pose(some, close, fitted, 2.0 * b.point, 0.05 * b.point, radius)
        transform = composed(fitted, Pose(-float(centre[0]), -float(centre[1]), 0.0))
        alignments.append(Alignment(transform, agreement(a, b, transform)))
    alignments.sort(key=lambda alignment: -alignment.agreement)
    different: list[Alignment] = []
    for alignment in alignments:
        if all(_mean_distance(walls, alignment.transform, chosen.transform) > _APART * cell for chosen in different):
            different.append(alignment)
    return different


def only_alignment(found: Sequence[Alignment]) -> Alignment:
    """Return the best place, the first one; BadInput if it is not good, or another is nearly as good."""
    best = found[0]
    if best.agreement < LEAST_AGREEMENT:
        raise BadInput(
            f"the maps do not lie on each other: at best {best.agreement:.0%} of their walls agree, and "
            f"{LEAST_AGREEMENT:.0%} must; give two --landmark or more"
        )
    rivals = [rival for rival in found[1:] if rival.agreement > best.agreement - LEAST_LEAD]
    if rivals:
        places = "; ".join(f"{spelled(rival.transform)} with {rival.agreement:.0%}" for rival in (best, *rivals[:3]))
        raise BadInput(
            f"the maps lie on each other in {1 + len(rivals)} ways or more, {places} of their walls agreeing; "
            "give two --landmark or more, to say which is right"
        )
    return best


def spelled(pose: Pose) -> str:
    """Return a pose as options take it, X,Y,HEADING in m and rad."""
    return ",".join(f"{round(value, 4) + 0.0:g}" for value in (pose.x, pose.y, pose.heading))


def moved(places: Places, pose: Pose) -> Places:
    """Return places in a frame from those in a child of it, whose pose there is `pose`."""
    return np.asarray(_turn_places(places, pose.heading) + np.array((pose.x, pose.y)))


def _coarse_poses(a: WallMap, centre: Places, b: WallMap, cell: float, radius: float) -> list[Pose]:
    """Return the best places of A's middle on a coarse grid, as poses of A turned about that."""
    walls = a.places() - centre
    known_points = (a.places(a.known) - centre)[:: max(1, int(cell / a.point))]
    known_points = known_points[np.hypot(*known_points.T) < radius]
    side = 2 * math.ceil(radius / cell) + 4
    shape = tuple(math.ceil(count * b.point / cell) for count in b.walls.shape)
    sizes = [16 * math.ceil((count + side) / 16) for count in shape]
    on_b, around_b = (_raster_cells(b.places(mask) - np.array(b.origin), cell, shape) for mask in (b.walls, b.known))
    walls_b, near_b, known_b = (np.fft.rfft2(mask, sizes) for mask in (on_b, grown(on_b), around_b | grown(on_b)))
    turns = math.ceil(2.0 * math.pi * radius / (1.5 * cell))
    middle = np.full(2, 0.5 * side * cell)
    peaks: list[tuple[float, Pose]] = []
    for turn in range(turns):
        heading = 2.0 * math.pi * turn / turns
        turned = (_turn_places(places, heading) + middle for places in (walls, known_points))
        on_a, around_a = (_raster_cells(places, cell, (side, side)) for places in turned)
        near_a = grown(on_a)
        of_walls, of_near, of_known = (np.conj(np.fft.rfft2(mask, sizes)) for mask in (on_a, near_a, grown(around_a)))
        hits = np.fft.irfft2(of_walls * near_b + of_near * walls_b, sizes)
        common = np.maximum(np.fft.irfft2(of_walls * known_b, sizes), LEAST_COMMON * np.count_nonzero(on_a))
        common += np.maximum(np.fft.irfft2(of_known * walls_b, sizes), LEAST_COMMON * np.count_nonzero(on_b))
        score = hits / common
        for _ in range(_PEAKS):
            peak_cell = np.unravel_index(int(score.argmax()), score.shape)
            shifts = [*zip(map(int, peak_cell), sizes, strict=True)]
            up, across = (shift - (shift >= size - side) * size for shift, size in shifts)
            x, y = b.origin[0] + (across + side // 2) * cell, b.origin[1] + (up + side // 2) * cell
            peaks.append((float(score[peak_cell]), Pose(x, y, heading)))
            around = (np.arange(shift - 2, shift + 3) % size for shift, size in shifts)
            score[np.ix_(*around)] = 0.0
    best: list[Pose] = []
    for _, pose in sorted(peaks, key=lambda peak: -peak[0]):
        if len(best) < _TRIED and all(_mean_distance(walls, pose, earlier) > _APART * cell for earlier in best):
            best.append(pose)
    return best


class _Nearness:
    """The nearness of places to a map's walls: 1 on them, falling evenly to 0 at `reach` points."""

    def __init__(self, walls: WallMap, reach: int) -> None:
        near = np.pad(walls.walls, reach + 1)
        field = near.astype(np.float64)
        for _ in range(reach):
            near = grown(near)
            field += near
        self._field = field / (reach + 1.0)
        self._point = walls.point
        self._corner = np.array(walls.origin) - (reach + 1) * walls.point

    def of(self, places: Places) -> float:
        """Return the mean nearness of places, between points by bilinear interpolation; 0 off the map."""
        height, width = self._field.shape
        positions = (places - self._corner) / self._point - 0.5
        positions = positions[((positions >= 0.0) & (positions < (width - 1, height - 1))).all(axis=1)]
        low = positions.astype(np.int64)
        across, up = (positions - low).T
        col, row = low.T
        field = self._field
        below = field[row, col] * (1.0 - across) + field[row, col + 1] * across
        above = field[row + 1, col] * (1.0 - across) + field[row + 1, col + 1] * across
        return float((below * (1.0 - up) + above * up).sum()) / len(places)


def _settle_pose(walls: Places, near: _Nearness, pose: Pose, step: float, least: float, radius: float) -> Pose:
    """Return the pose near another where walls are nearest to those of a map; in ever smaller steps, m."""
    best, score = pose, near.of(moved(walls, pose))
    while step >= least:
        moves = ((step, 0.0, 0.0), (0.0, step, 0.0), (0.0, 0.0, step / radius))
        tried = [
            Pose(best.x + sign * x, best.y + sign * y, best.heading + sign * heading)
            for x, y, heading in moves
            for sign in (1.0, -1.0)
        ]
        scores = [near.of(moved(walls, candidate)) for candidate in tried]
        index = int(np.argmax(scores))
        if scores[index] > score:
            best, score = tried[index], scores[index]
        else:
            step *= 0.5
    return best


def _mean_distance(walls: Places, one: Pose, other: Pose) -> float:
    """Return how far two poses put the same walls apart, m: the mean of all."""
    return float(np.hypot(*(moved(walls, one) - moved(walls, other)).T).mean())


def _turn_places(places: Places, heading: float) -> Places:
    cos, sin = math.cos(heading), math.sin(heading)
    return np.asarray(places @ np.array([[cos, sin], [-sin, cos]]))


def _raster_cells(places: Places, cell: float, shape: tuple[int, ...]) -> BoolGrid:
    """Return the cells that hold a place, which count from (0, 0)."""
    cells = np.floor(places / cell).astype(np.int64)
    mask = np.zeros(shape, dtype=np.bool_)
    mask[cells[:, 1], cells[:, 0]] = True
    return mask


def _count_marked(mask: BoolGrid, of: WallMap, places: Places) -> float:
    """Count the places on marked points of a map."""
    cells = np.floor((places - of.origin) / of.point).astype(np.int64)
    inside = ((cells >= 0) & (cells < mask.shape[::-1])).all(axis=1)
    return float(np.count_nonzero(mask[cells[inside, 1], cells[inside, 0]]))
