"""Graphs of places: what the patrols of the literature run on, and by which they are measured.

A graph is read from a `.graph` file, in the format of patrolling_sim, or made from the ground of a terrain that comes
without one. Fogwatch's own policies do not need one.

A file holds numbers separated by white space: vertices, width and height of the image in pixels, resolution in m per
pixel, x and y offset in m; then for each vertex its number, x and y in pixels (y upwards), its number of neighbours,
and for each of them its number, the direction (N, NE, ...) and the length of the way there in pixels. All numbers here
are in metres.

The vertices of a graph made from the ground are places from which all of it is seen, as few as a greedy choice finds;
so robots that visit all of them see everything. Two are neighbours where no third one is nearer to both of them, by the
ways between them (the relative neighbourhood graph), which keeps the graph connected where the ground is, and its ways
short.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from patrol.errors import BadInput, printable
from patrol.files.foreign import BUILDING, kind_of_mapping
from patrol.files.untrusted import GRAPH
from patrol.files.yaml_text import parse_yaml, read_text

if TYPE_CHECKING:
    from patrol.ground.fields import StaticFields
    from patrol.ground.footprint import Footprint
    from patrol.ground.terrain import BoolGrid, Terrain

Places = Sequence[tuple[float, float]]
"""x and y of vertices, m."""

VISIT_M = 0.4
"""Distance within which a robot visits a place unless told otherwise, m: the goal tolerance of patrolling_sim."""

PIXEL = 0.075
"""Side of a pixel where no image says it, m: that of patrolling_sim's maps cumberland and grid."""


@dataclass(frozen=True, eq=False)
class Graph:
    """A graph without loops; ways lead in both directions."""

    places: NDArray[np.float64]  # (v, 2), x and y of each vertex, m
    # by vertex: neighbours with the length of the way there, m, in the file's order
    edges: tuple[tuple[tuple[int, float], ...], ...]
    pixel: float = PIXEL  # side of its image's pixels, m, in which rules of the literature count
    visit: float = VISIT_M  # distance within which a robot visits a vertex, m

    @property
    def size(self) -> int:
        """Number of vertices."""
        return len(self.edges)

    @cached_property
    def lengths(self) -> NDArray[np.float64]:
        """float64 (v, v), lengths of the shortest ways between vertices, m (Floyd and Warshall)."""
        lengths = np.full((self.size, self.size), np.inf)
        np.fill_diagonal(lengths, 0.0)
        for vertex, neighbours in enumerate(self.edges):
            for neighbour, length in neighbours:
                lengths[vertex, neighbour] = min(lengths[vertex, neighbour], length)
        for by in range(self.size):
            np.minimum(lengths, lengths[:, by, None] + lengths[None, by, :], out=lengths)
        lengths.flags.writeable = False
        return lengths

    @cached_property
    def hops(self) -> NDArray[np.float64]:
        """float64 (v, v), the least number of edges between vertices; infinity without a way."""
        return Graph(self.places, tuple(tuple((neighbour, 1.0) for neighbour, _ in row) for row in self.edges)).lengths

    def step(self, vertex: int, goal: int) -> int:
        """Return the next vertex on the shortest way to a goal; the goal itself when it is there already."""
        if vertex == goal:
            return vertex
        return min(
            (length + float(self.lengths[neighbour, goal]), neighbour) for neighbour, length in self.edges[vertex]
        )[1]

    def way(self, vertex: int, goal: int) -> list[int]:
        """Return the vertices on the shortest way to a goal, without the first one and with the goal.

        The list is empty where both are one; otherwise a way must lead to the goal.
        """
        way: list[int] = []
        while vertex != goal:
            vertex = self.step(vertex, goal)
            way.append(vertex)
        return way

    def nearest(self, x: float, y: float) -> int:
        """Return the vertex that is nearest to a place as the crow flies."""
        return int(np.argmin(((self.places - (x, y)) ** 2).sum(axis=1)))

    def visit_reach(self, speed: float, step: float) -> float:
        """Return the distance (m) within which a robot of some speed (m/s) visits a vertex.

        It is `visit`, or half of what the robot drives in a tick of `step` s where that is more.
        """
        return max(self.visit, 0.5 * speed * step)

    def within(self, first: tuple[float, float], last: tuple[float, float], reach: float) -> list[int]:
        """Return the vertices no farther than `reach` (m) from a straight stretch, in order along it.

        Its very beginning does not count: a robot that leaves a vertex does not visit it anew.
        """
        begin, way = np.array(first), np.subtract(last, first)
        along = np.clip((self.places - begin) @ way / max(float(way @ way), 1e-12), 0.0, 1.0)
        off = self.places - begin - along[:, None] * way
        at_end = ((self.places - last) ** 2).sum(axis=1) <= reach * reach
        beside = np.flatnonzero(at_end | ((off**2).sum(axis=1) <= reach * reach) & (along > 0.0))
        return [int(vertex) for vertex in beside[np.argsort(along[beside], kind="stable")]]


def graph_of(
    places: Sequence[tuple[float, float]],
    edges: Sequence[tuple[int, int, float]],
    pixel: float = PIXEL,
    visit: float = VISIT_M,
) -> Graph:
    """Make a graph from its vertices and its edges, each named once.

    A place is x and y in m. An edge is two vertices and the length of the way between them in m.
    """
    rows: list[list[tuple[int, float]]] = [[] for _ in places]
    for first, last, length in edges:
        rows[first].append((last, length))
        rows[last].append((first, length))
    return Graph(np.array(places, dtype=np.float64).reshape(-1, 2), tuple(map(tuple, rows)), pixel, visit)


DIRECTIONS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")

MOST_VERTICES = 2000
"""Vertices of the largest graph: policies keep a length for each pair."""

LARGEST = 1e6
"""The greatest coordinate, m."""


class _Words:
    """The words of a file, one after the other, each with its line for errors."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._words = self._split_words(read_text(path, GRAPH))
        self._line = 1

    @staticmethod
    def _split_words(text: str) -> Iterator[tuple[int, str]]:
        for number, line in enumerate(text.splitlines(), 1):
            for word in line.split():
                yield number, word

    def wrong(self, problem: str) -> BadInput:
        """Make the error about the word that was read last."""
        return BadInput(f"{self._path}: line {self._line}: {problem}")

    def text(self, what: str) -> str:
        """Return the next word."""
        token = next(self._words, None)
        if token is None:
            raise BadInput(f"{self._path}: ends where {what} should be; expected a .graph file of patrolling_sim")
        self._line, word = token
        return word

    def number(self, what: str) -> float:
        """Return the next word as a finite number."""
        word = self.text(what)
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not abs(value) <= LARGEST:
            raise self.wrong(f"{printable(word)[:40]}: expected {what}, a number")
        return value

    def whole(self, what: str, least: int, most: int) -> int:
        """Return the next word as a whole number within bounds."""
        value = self.number(what)
        if not value.is_integer() or not least <= value <= most:
            raise self.wrong(f"{value:g}: expected {what}, a whole number from {least} to {most}")
        return int(value)

    def end(self) -> None:
        """Refuse more words."""
        if (extra := next(self._words, None)) is not None:
            raise BadInput(f"{self._path}: line {extra[0]}: {printable(extra[1])[:40]}: more than the vertices above")


def read_graph(path: Path, map_image: tuple[int, int] | None = None) -> dict[str, Any]:
    """Read a `.graph` file, a navigation graph of Open-RMF (YAML) or a route graph of Nav2 (GeoJSON).

    Returns ``vertices``, x and y of each in m; ``edges``, each once in the file's order, as two vertices and the length
    in m; and ``pixel``, the resolution in m. `map_image` is the width and height in pixels that the file must name,
    None for any.
    """
    if path.suffix.lower() in LANES:
        return _read_lanes(path)
    words = _Words(path)
    count = words.whole("the number of vertices", 1, MOST_VERTICES)
    width, height = (words.number(f"the image's {side}") for side in ("width", "height"))
    if map_image is not None and map_image != (width, height):
        has = f"the map's has {map_image[0]} x {map_image[1]}"
        raise words.wrong(f"is made for an image of {width:g} x {height:g} pixels, and {has}; give this map's graph")
    resolution = words.number("the resolution in m per pixel")
    if resolution <= 0.0:
        raise words.wrong(f"{resolution:g}: expected the resolution in m per pixel, above 0")
    offset = words.number("the x offset in m"), words.number("the y offset in m")
    places: list[tuple[float, float]] = []
    lengths: dict[tuple[int, int], float] = {}
    for vertex in range(count):
        if words.whole("a vertex's number", 0, count - 1) != vertex:
            raise words.wrong(f"expected vertex {vertex}: they stand in order")
        x, y = (words.number("a vertex's place in pixels") for _ in range(2))
        places.append((round(x * resolution + offset[0], 6), round(y * resolution + offset[1], 6)))
        for _ in range(words.whole("a vertex's number of neighbours", 0, count - 1)):
            neighbour = words.whole("a neighbour's number", 0, count - 1)
            if words.text("a neighbour's direction") not in DIRECTIONS:
                raise words.wrong(f"expected a neighbour's direction: {' '.join(DIRECTIONS)}")
            length = round(words.number("the length of an edge in pixels") * resolution, 6)
            if neighbour == vertex or length <= 0.0:
                raise words.wrong("expected a neighbour other than the vertex itself, at a length above 0")
            lengths.setdefault((min(vertex, neighbour), max(vertex, neighbour)), length)
    words.end()
    edges = [(first, last, length) for (first, last), length in lengths.items()]
    return {"vertices": places, "edges": edges, "pixel": resolution}


LANES = (".yaml", ".yml", ".json", ".geojson")
"""Endings of graphs whose ways are lanes between named places, in m on the map."""


def _read_lanes(path: Path) -> dict[str, Any]:
    """Read a graph of lanes, whose direction does not count; each is as long as it is straight."""
    content = parse_yaml(read_text(path, GRAPH), str(path))
    levels = content.get("levels") if isinstance(content, dict) else None
    features = content.get("features") if isinstance(content, dict) else None
    try:
        if isinstance(levels, dict):
            if kind_of_mapping(content).startswith(BUILDING):
                raise BadInput(f"{path}: {BUILDING}, in pixels; give the navigation graph that is made from it")
            if len(levels) != 1:
                there = ", ".join(map(str, levels)) or "none"
                raise BadInput(f"{path}: levels: has {there}; expected one, that of the map")
            (level,) = levels.values()
            places = {number: vertex[:2] for number, vertex in enumerate(level["vertices"])}
            lanes = [lane[:2] for lane in level["lanes"]]
        elif isinstance(features, list):
            points = [feature for feature in features if feature["geometry"]["type"] == "Point"]
            places = {point["properties"]["id"]: point["geometry"]["coordinates"][:2] for point in points}
            if len(places) < len(points):
                raise BadInput(f"{path}: two places have the same id; correct it")
            ways = [feature["properties"] for feature in features if feature["geometry"]["type"] != "Point"]
            lanes = [(way["startid"], way["endid"]) for way in ways]
        else:
            raise BadInput(f"{path}: expected the levels of Open-RMF's navigation graph, or the features of GeoJSON")
        if any(isinstance(value, bool) for value in chain(*places.values(), *lanes)):
            raise TypeError("true or false instead of a number")
        numbers = {name: number for number, name in enumerate(places)}
        vertices = [(float(x), float(y)) for x, y in places.values()]
        pairs = {(min(a, b), max(a, b)): None for a, b in ((numbers[a], numbers[b]) for a, b in lanes)}
    except (KeyError, TypeError, ValueError, IndexError) as error:
        reason = f"{type(error).__name__}: {error}"
        raise BadInput(
            f"{path}: is no graph of lanes between its places ({printable(reason)[:80]}); correct it"
        ) from None
    if not 0 < len(vertices) <= MOST_VERTICES or not all(
        abs(value) <= LARGEST for place in vertices for value in place
    ):
        raise BadInput(f"{path}: expected 1 to {MOST_VERTICES} places, at most {LARGEST:g} m away; leave some out")
    edges = [(a, b, round(math.dist(vertices[a], vertices[b]), 6)) for a, b in pairs if vertices[a] != vertices[b]]
    return {"vertices": vertices, "edges": edges}


def check_vertices(vertices: Places, terrain: Terrain) -> None:
    """Refuse a graph of another terrain."""
    for number, (x, y) in enumerate(vertices):
        if not terrain.contains(x, y):
            where = f"terrain.graph: vertex {number} at [{x:g}, {y:g}]"
            raise BadInput(f"{where}: not on {terrain.name}; give the graph of this terrain")


def watching_vertices(
    vertices: Places, terrain: Terrain, by_radius: Mapping[float, StaticFields]
) -> dict[float, StaticFields]:
    """Leave nothing patrolled but the points that hold the graph's vertices."""
    cells = [terrain.point_at(*vertex) for vertex in vertices]
    points = np.zeros(terrain.shape, dtype=np.bool_)
    points[tuple(np.transpose(cells))] = True
    watching = {radius: fields.watching(points) for radius, fields in by_radius.items()}
    for number, point in enumerate(cells):
        if not any(fields.patrolled[point] for fields in watching.values()):
            x, y = terrain.centre(*point)
            where = f"terrain.graph: vertex {number} near [{x:.4g}, {y:.4g}]"
            raise BadInput(
                f"{where}: no robot sees it from ground that it can reach; correct the vertex, start a robot in its "
                "part of the terrain, or set terrain.patrolled to ground"
            )
    for radius, fields in watching.items():
        if not fields.patrolled.any():
            raise BadInput(
                f"terrain.patrolled: robots of radius {radius:g} m see no vertex from ground that they can reach; "
                "start them elsewhere or leave them out"
            )
    return watching


NEAR = 4.0
"""Length of the ways that are searched for first, in sensor ranges."""

Flat = NDArray[np.int64]


def on_reach(graph: Graph, terrain: Terrain, reach: BoolGrid) -> Graph:
    """Return a graph whose vertices a body can stand on: the others move to the nearest place where it can.

    The edges keep their lengths.
    """
    rows, cols = np.nonzero(reach)
    x, y = terrain.origin
    across, up = x + (cols + 0.5) * terrain.point, y + (rows + 0.5) * terrain.point
    places = graph.places.copy()
    for vertex, (vertex_x, high) in enumerate(graph.places.tolist()):
        row, col = terrain.point_at(vertex_x, high)
        if not terrain.inside(row, col) or not reach[row, col]:
            nearest = int(np.argmin((across - vertex_x) ** 2 + (up - high) ** 2))
            places[vertex] = across[nearest], up[nearest]
    return Graph(places, graph.edges, graph.pixel, graph.visit)


def graph_from_ground(terrain: Terrain, fields: StaticFields, footprint: Footprint) -> Graph:
    """Make the graph of the ground of one kind of body."""
    from patrol.ground.ways import framed, lengths_among  # here, as everywhere: few runs need a graph, and its kernels
    from patrol.kernels.ways import FAR
    from patrol.tours.cover import Looks, Views, complete, cover_roughly, needed

    part = np.asarray(fields.reach)
    looks = Looks(terrain, footprint)
    chosen, _ = cover_roughly(looks, fields.patrolled, part, fields.proxy, footprint)
    exact = Views(looks, fields.patrolled, 1)
    for cell in chosen:
        exact.add(cell)
    places = sorted(needed(chosen + complete(exact, part, fields.proxy), exact))
    rows, cols = np.divmod(np.array(places, dtype=np.int64), terrain.width)
    # Longer ways may lead through other places; those that have one in between are no neighbours anyway.
    limit = round(100.0 * NEAR * footprint.radius)
    lengths = lengths_among(framed(part), (rows + 1) * (terrain.width + 2) + cols + 1, limit)
    edges = []
    for first in range(len(places)):
        for last in range(first + 1, len(places)):
            way = lengths[first, last]
            if way < FAR and not (np.maximum(lengths[first], lengths[last]) < way).any():
                edges.append((first, last, float(way) * terrain.point / 100.0))
    return graph_of([terrain.centre(int(row), int(col)) for row, col in zip(rows, cols, strict=True)], edges)


STARTS = 6
"""Number of tours that are shortened, each from another vertex on; the shortest is taken."""


def closed_tour(graph: Graph, vertices: Iterable[int]) -> list[int]:
    """Find a short closed tour through some vertices, by the ways of the graph; it begins with the least.

    From several vertices on, the nearest one comes next; then 2-opt and Or-opt shorten the tour. Vertices that no way
    leads to from the first one are left out. There must be at least one.
    """
    from patrol.kernels.tour import shorten

    every = sorted(set(vertices))
    reachable = [vertex for vertex in every if graph.lengths[every[0], vertex] < np.inf]
    lengths = np.rint(1000.0 * graph.lengths[np.ix_(reachable, reachable)]).astype(np.int32)
    best, shortest = list(range(len(reachable))), None
    for begin in np.linspace(0, len(reachable) - 1, min(STARTS, len(reachable))).astype(int).tolist():
        tour, remaining = [begin], set(range(len(reachable))) - {begin}
        while remaining:
            tour.append(min(remaining, key=lambda vertex: (int(lengths[tour[-1], vertex]), vertex)))
            remaining.remove(tour[-1])
        order = np.array(tour, dtype=np.int64)
        length = int(shorten(lengths, order))
        if shortest is None or length < shortest:
            best, shortest = order.tolist(), length
    first = best.index(0)
    return [reachable[index] for index in best[first:] + best[:first]]


def tour_length(graph: Graph, tour: list[int]) -> float:
    """Return the length of a closed tour, m."""
    return sum(float(graph.lengths[tour[index - 1], vertex]) for index, vertex in enumerate(tour))
