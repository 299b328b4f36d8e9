"""The free ground as convex pieces: its outline with few corners, cut into triangles, which are merged while convex.

Polygons are float64 (k, 2), counter-clockwise, in points. The triangles are those of a constrained Delaunay
triangulation. They are merged the smallest first, each piece with the neighbour that makes the most compact whole.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely
from numpy.typing import NDArray

from patrol.errors import BadInput
from patrol.ground.terrain import Terrain
from patrol.regions.convex import Floats

SMOOTHED = 1.5
"""Points: the outline with few corners may differ from the ground's by so much, as at the stairs of slanted walls."""

POCKET = 1.0
"""Points: the greatest width of walls that a merged piece may hold beside its two pieces."""

MOST_CORNERS = 10_000
"""Corners of an outline that make about 3000 regions; the method is for terrains with far fewer."""

TOUCHING = 1e-6
"""Polygons that overlap by less than this, in points or square points, only touch."""


def convex_pieces(terrain: Terrain) -> list[Floats]:
    """Cut the free ground of a terrain into convex pieces; a terrain with too many corners is refused."""
    edges = np.diff(np.pad(terrain.free, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    (rows, begins), (_, ends) = np.nonzero(edges > 0), np.nonzero(edges < 0)
    # Runs of free points along a row as one box each: far fewer than points.
    outline = shapely.union_all(shapely.box(begins, rows, ends, rows + 1)).simplify(SMOOTHED)
    if (corners := shapely.get_num_coordinates(outline)) > MOST_CORNERS:
        raise BadInput(
            f"patrol.options.paths = regions: the outline of {terrain.name} has {corners} corners, and at most "
            f"{MOST_CORNERS} are allowed; choose wave, or a larger point"
        )
    pieces = _Pieces(shapely.get_parts(shapely.constrained_delaunay_triangles(outline)))
    return [shapely.get_coordinates(piece.exterior)[:-1] for piece in pieces.merged()]


def nearest_pieces(pieces: list[Floats], places: Floats) -> NDArray[np.int32]:
    """Return the index of the piece that is nearest to each place, float64 (n, 2), in points."""
    tree = shapely.STRtree([shapely.Polygon(piece) for piece in pieces])
    return np.asarray(tree.nearest(shapely.points(places)), dtype=np.int32)


class _Pieces:
    """Convex polygons side by side, and the boxes around them."""

    def __init__(self, polygons: NDArray[np.object_]) -> None:
        self._polygons = polygons
        self._boxes = shapely.bounds(polygons)

    def merged(self) -> list[shapely.Polygon]:
        """Merge the pieces, and return those that are left, counter-clockwise."""
        waiting = np.argsort(shapely.area(self._polygons), kind="stable").tolist()
        while waiting:
            number = waiting.pop(0)
            if not np.isfinite(self._boxes[number, 0]):
                continue
            mergers = [
                (shapely.area(outline) / shapely.length(outline) ** 2, partner, outline)
                for partner, outline in self._mergers(number)
            ]
            if mergers:
                # The first of equal ones, in the order of their numbers, so that the split is the same everywhere.
                _, partner, outline = max(mergers, key=lambda merger: merger[0])
                self._polygons[number], self._boxes[number] = outline, shapely.bounds(outline)
                # An empty box: the piece is part of the other one now and is nobody's neighbour.
                self._boxes[partner] = np.inf, np.inf, -np.inf, -np.inf
                # Last, since it has grown: the smallest come first.
                waiting.append(number)
        return [shapely.orient_polygons(piece) for piece in self._polygons[np.isfinite(self._boxes[:, 0])]]

    def _mergers(self, number: int) -> Iterator[tuple[int, shapely.Geometry]]:
        """Give the pieces that a piece can be merged with: their numbers, and the convex hull of both."""
        piece = self._polygons[number]
        for partner in self._near(piece, number):
            neighbour = self._polygons[partner]
            union = shapely.union(piece, neighbour, grid_size=TOUCHING)
            outline = shapely.convex_hull(union)
            pockets = shapely.difference(outline, union)
            border = 0.5 * float(shapely.length([piece, neighbour]).sum() - shapely.length(union))
            # A wall between two pieces is as thin as a pocket, but longer than what they have in common.
            is_thin = shapely.is_empty(shapely.buffer(pockets, -0.5 * POCKET, join_style="mitre"))
            if not is_thin or shapely.area(pockets) > POCKET * border:
                continue
            nearby_pieces = self._polygons[self._near(outline, number, partner)]
            if shapely.area(shapely.intersection(nearby_pieces, outline)).max(initial=0.0) <= TOUCHING:
                yield partner, outline

    def _near(self, polygon: shapely.Geometry, *besides: int) -> list[int]:
        """Return the numbers of the other pieces that touch a polygon."""
        low, high = np.split(shapely.bounds(polygon), 2)
        near = (self._boxes[:, :2] <= high + TOUCHING) & (self._boxes[:, 2:] >= low - TOUCHING)
        numbers = np.setdiff1d(np.flatnonzero(near.all(axis=1)), besides)
        return [int(number) for number in numbers[shapely.dwithin(self._polygons[numbers], polygon, TOUCHING)]]
