"""Regions: the ground as a few convex pieces and the points that connect them (paper, "The region method").

Within a region a robot may go straight from anywhere to anywhere, so that a path is a sequence of connecting points.
The paper splits terrains by hand; `split_regions` does it for any terrain (`patrol.regions.pieces`).

Polygons are convex and disjoint to a millionth of a point. Every point where bodies may be belongs to one; its centre
lies in that polygon or up to about a point beside it. Polygons may reach into walls by about as much, which is where
the stairs of slanted walls and small poles go.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from patrol.errors import BadInput
from patrol.ground.cspace import parts_of
from patrol.ground.fields import StaticFields, load_grid, save_grids
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.kernels.regions import fill, split_parts, spread
from patrol.regions.convex import Floats, area, circumference, depths, hull, overlap

__all__ = ["Connection", "Polygon", "RegionSplit", "regions_by_hand", "split_regions"]

Ints = NDArray[np.int32]

Polygon = tuple[tuple[float, float], ...]
"""Corners (x, y) in m, counter-clockwise."""

BY_HAND = 0.25
"""Error allowed in polygons given by hand, m, or a point where that is more: overlaps, gaps to the walls, dents."""

FACTS = "regions.json"
GRIDS = ("labels", "parts")


@dataclass(frozen=True, eq=False)
class RegionSplit:
    """A terrain's regions, and how a body gets from one to another. Arrays are read-only."""

    polygons: tuple[Polygon, ...]  # by region number
    labels: NDArray[np.int32]  # (h, w), the region of every point where bodies may be, -1 elsewhere
    # (h, w), -1 where the body's centre may not be; a region that walls or the body's width divide has several
    parts: NDArray[np.int32]
    connections: tuple[Connection, ...]  # one for each stretch of border between parts that the body can pass

    def for_body(self, terrain: Terrain, body: BoolGrid) -> RegionSplit:
        """Return the same regions, connected for another body, whose centre may be at the points of `body`."""
        parts, connections = connect(terrain, self.labels, body & terrain.free)
        return replace(self, parts=parts, connections=connections)

    def save(self, folder: Path) -> None:
        """Write the arrays as .npy files and the rest as JSON."""
        save_grids(folder, self, GRIDS)
        links = [[link.x, link.y, link.regions, link.parts, link.points] for link in self.connections]
        facts = {"polygons": self.polygons, "connections": links}
        (folder / FACTS).write_text(json.dumps(facts), encoding="utf-8")

    @staticmethod
    def load(folder: Path) -> RegionSplit:
        """Load the files of `save`, with memory-mapped, read-only arrays."""
        facts = json.loads((folder / FACTS).read_text(encoding="utf-8"))
        labels, parts = (load_grid(folder / f"{name}.npy") for name in GRIDS)
        links = tuple(
            Connection(x, y, (regions[0], regions[1]), (ends[0], ends[1]), (points[0], points[1]))
            for x, y, regions, ends, points in facts["connections"]
        )
        polygons = tuple(tuple((x, y) for x, y in polygon) for polygon in facts["polygons"])
        return RegionSplit(polygons, labels, parts, links)


def split_regions(terrain: Terrain, body: BoolGrid | None = None) -> RegionSplit:
    """Split a terrain's free ground into convex regions.

    Connections lie where a body's centre may be: at the points of `body`, or at all free points when it is None.
    """
    try:
        from patrol.regions.pieces import convex_pieces, nearest_pieces  # here: its library is an extra
    except ImportError:
        raise BadInput(
            "patrol.options.paths = regions: splitting a terrain needs shapely; install it with: "
            "pip install 'fogwatch[experiments]', or give patrol.options.regions"
        ) from None
    polygons = convex_pieces(terrain) if terrain.free.any() else []
    labels = _label_points(terrain, polygons)
    rows, cols = np.nonzero(terrain.free & (labels < 0))
    if rows.size:
        labels[rows, cols] = nearest_pieces(polygons, np.stack([cols, rows], axis=1).astype(np.float64) + 0.5)
    return _make_split(terrain, polygons, labels, body)


def regions_by_hand(
    terrain: Terrain, polygons: Sequence[Sequence[tuple[float, float]]], body: BoolGrid | None = None
) -> RegionSplit:
    """Return the split that the user's polygons describe.

    Their corners are (x, y) in m, either way round. They need not follow walls closely: what they cover of them does
    not count, and free points up to BY_HAND beside a region belong to it. Gaps between them are refused, but ground to
    which `body` has no access need not be covered; `body` is as in `split_regions`.
    """
    slack = _overlap_slack(terrain)
    corners = [_check_polygon(terrain, number, polygon) for number, polygon in enumerate(polygons)]
    for number, polygon in enumerate(corners):
        for earlier in range(number):
            if (depth := overlap(polygon, corners[earlier])) > slack:
                raise BadInput(
                    f"patrol.options.regions.{number}: overlaps region {earlier} by {depth * terrain.point:.2f} m; "
                    "move their common border"
                )
    labels = _label_points(terrain, corners)
    for number in range(len(corners)):
        if not (labels == number).any():
            raise BadInput(
                f"patrol.options.regions.{number}: holds no free point of {terrain.name}; correct or drop it"
            )
    _check_gaps(terrain, labels, body)
    return _make_split(terrain, corners, labels, body)


def split_for_bodies(
    terrain: Terrain, polygons: Sequence[Polygon] | None, by_radius: Mapping[float, StaticFields]
) -> dict[float, RegionSplit]:
    """Make the regions, those given or automatic ones, and their connections for each radius."""
    everywhere = np.logical_or.reduce([fields.reach for fields in by_radius.values()])
    split = split_regions(terrain, everywhere) if polygons is None else regions_by_hand(terrain, polygons, everywhere)
    return {radius: split.for_body(terrain, fields.reach) for radius, fields in by_radius.items()}


def _label_points(terrain: Terrain, polygons: Sequence[Floats]) -> NDArray[np.int32]:
    """int32 (h, w): the polygon that each free point's centre lies in, the first of several, -1 in none.

    For example, a point whose centre lies on the border of polygons 0 and 1 has the label 0.
    """
    labels = np.full(terrain.shape, -1, dtype=np.int32)
    for number, polygon in enumerate(polygons):
        fill(np.ascontiguousarray(polygon), number, terrain.free.view(np.uint8), labels)
    return labels


def _make_split(
    terrain: Terrain, polygons: Sequence[Floats], labels: NDArray[np.int32], body: BoolGrid | None
) -> RegionSplit:
    """Number regions by their first points, give what no polygon holds to a neighbour, and connect."""
    free = terrain.free.view(np.uint8)
    spread(free, labels.size, labels, np.empty(labels.size, dtype=np.int32))
    # By first points, so that the numbers do not depend on the order in which pieces were merged.
    numbers, first = np.unique(labels, return_index=True)
    remaining = [int(number) for number in numbers[np.argsort(first)] if number >= 0]
    renumbered = np.full(len(polygons) + 1, -1, dtype=np.int32)
    renumbered[remaining] = np.arange(len(remaining), dtype=np.int32)
    labels = renumbered[labels]
    labels.flags.writeable = False
    split = RegionSplit(tuple(_in_metres(terrain, polygons[number]) for number in remaining), labels, labels, ())
    return split.for_body(terrain, terrain.free if body is None else body)


def _in_metres(terrain: Terrain, polygon: Floats) -> Polygon:
    ox, oy = terrain.origin
    return tuple((ox + float(x) * terrain.point, oy + float(y) * terrain.point) for x, y in polygon)


def _check_polygon(terrain: Terrain, number: int, polygon: Sequence[tuple[float, float]]) -> Floats:
    """Return a polygon given by hand, in points, convex and counter-clockwise."""
    where = f"patrol.options.regions.{number}"
    if len(polygon) < 3:
        raise BadInput(f"{where}: has {len(polygon)} corners; give at least 3")
    corners = (np.array(polygon, dtype=np.float64) - terrain.origin) / terrain.point
    outline = hull(corners)
    if len(outline) < 3 or area(outline) < 1.0:
        raise BadInput(f"{where}: covers less than one point; give corners that do not lie on one line")
    deepest = int(np.argmax(depths(outline, corners)))
    if depths(outline, corners)[deepest] > _overlap_slack(terrain):
        x, y = polygon[deepest]
        raise BadInput(f"{where}: is not convex at ({x:g}, {y:g}); split it there into two regions")
    if area(outline) - abs(area(corners)) > _overlap_slack(terrain) * circumference(outline):
        raise BadInput(f"{where}: its sides cross; list the corners in order along the border")
    return outline


def _overlap_slack(terrain: Terrain) -> float:
    """Return the error allowed in polygons given by hand, in points."""
    return max(BY_HAND / terrain.point, 1.0)


def _check_gaps(terrain: Terrain, labels: NDArray[np.int32], body: BoolGrid | None) -> None:
    """Give free points beside a region to it; BadInput when points that matter are still in none."""
    bare = terrain.free & (labels < 0)
    spread(
        terrain.free.view(np.uint8), math.ceil(_overlap_slack(terrain)), labels, np.empty(labels.size, dtype=np.int32)
    )
    if body is not None:
        rooms, _ = parts_of(terrain.free)
        bare &= np.isin(rooms, np.unique(rooms[body & terrain.free]))
    gaps, count = parts_of(bare)
    is_gap = np.bincount(gaps.ravel(), weights=(labels < 0).ravel(), minlength=count + 1) > 0
    # Label 0 is all the ground that is not bare.
    is_gap[0] = False
    if not is_gap.any():
        return
    areas = np.where(is_gap, np.bincount(gaps.ravel(), minlength=count + 1), 0) * terrain.point_area
    row, col = np.argwhere(gaps == int(np.argmax(areas))).mean(axis=0)
    ox, oy = terrain.origin
    x, y = ox + (col + 0.5) * terrain.point, oy + (row + 0.5) * terrain.point
    raise BadInput(
        f"patrol.options.regions: {areas.sum():.2f} m2 of free ground lie in no region, {areas.max():.2f} m2 of them "
        f"around ({x:.2f}, {y:.2f}); widen the regions or add one"
    )


GAP = 2.0
"""Places on a border further apart than this, in points, belong to separate stretches."""


@dataclass(frozen=True, slots=True)
class Connection:
    """A place where a body passes from one region to another."""

    x: float  # m, centre of the first of `points`
    y: float  # m
    regions: tuple[int, int]
    parts: tuple[int, int]  # numbers of the two parts of regions
    points: tuple[int, int]  # flat indices of the neighbouring points on either side


def connect(terrain: Terrain, labels: Ints, body: BoolGrid) -> tuple[Ints, tuple[Connection, ...]]:
    """Return the parts of regions in which a body's centre may be, and the connections between them.

    Parts are int32 (h, w), -1 where the centre may not be; `labels` has region numbers, -1 for none. There is one
    connection in the middle of each stretch of border that the body can pass, in the order of the parts.
    """
    parts = np.empty(labels.shape, dtype=np.int32)
    work = np.empty(labels.size, dtype=np.int32)
    split_parts(np.ascontiguousarray(body).view(np.uint8), np.ascontiguousarray(labels), parts, work)
    low, high = _border_points(parts)
    flat = parts.ravel()
    pairs = np.stack([flat[low], flat[high]], axis=1)
    order = np.lexsort((high, low, pairs[:, 1], pairs[:, 0]))
    low, high, pairs = low[order], high[order], pairs[order]
    starts = np.flatnonzero((np.diff(pairs, axis=0, prepend=-1) != 0).any(axis=1))
    connections = []
    for start, stop in pairwise([*map(int, starts), low.size]):
        for index in _border_middles(low[start:stop], high[start:stop], terrain.width):
            first, second = int(low[start + index]), int(high[start + index])
            x, y = terrain.centre(*divmod(first, terrain.width))
            regions = (int(labels.flat[first]), int(labels.flat[second]))
            connections.append(Connection(x, y, regions, (int(flat[first]), int(flat[second])), (first, second)))
    parts.flags.writeable = False
    return parts, tuple(connections)


def _border_points(parts: Ints) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Flat indices of the neighbouring points that lie in two parts, that of the lower part first."""
    index = np.arange(parts.size, dtype=np.int64).reshape(parts.shape)
    sides = [(parts[:, :-1], parts[:, 1:], index[:, :-1], index[:, 1:]), (parts[:-1], parts[1:], index[:-1], index[1:])]
    ends = []
    for region, neighbour, at_one, at_two in sides:
        apart = (region >= 0) & (neighbour >= 0) & (region != neighbour)
        ends.append(np.stack([at_one[apart], at_two[apart]], axis=1))
    joined = np.concatenate(ends)
    # Pairs are grouped by both parts below, so (2, 1) must read as (1, 2).
    swapped = parts.ravel()[joined[:, 0]] > parts.ravel()[joined[:, 1]]
    joined[swapped] = joined[swapped][:, ::-1]
    return joined[:, 0], joined[:, 1]


def _border_middles(first: NDArray[np.int64], second: NDArray[np.int64], width: int) -> list[int]:
    """Return the index of the middle pair of points of each stretch of the border between two parts."""
    places = 0.5 * (np.stack(np.divmod(first, width), axis=1) + np.stack(np.divmod(second, width), axis=1))
    # Two convex regions meet along a straight line, so places are in order along the way from one end to the other.
    end = places[np.argmax(np.hypot(*(places - places[0]).T))]
    way = places[np.argmax(np.hypot(*(places - end).T))] - end
    along = (places - end) @ (way / max(float(np.hypot(*way)), 1.0))
    order = np.argsort(along, kind="stable")
    stretches = np.split(order, np.flatnonzero(np.diff(along[order]) > GAP) + 1)
    middles = []
    for stretch in stretches:
        middle = 0.5 * (along[stretch[0]] + along[stretch[-1]])
        middles.append(int(stretch[np.argmin(np.abs(along[stretch] - middle))]))
    return middles
