from __future__ import annotations

import heapq
import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from patrol.errors import BadInput
from patrol.graph import Graph, closed_tour, graph_from_ground, graph_of, read_graph, tour_length
from patrol.pose import Pose
from patrol.prepare import prepare, sensor_footprint
from patrol.scenario import load_scenario, scenario_hash
from tests.patrol.ground.masks import on_terrain
from tests.patrol.maps.test_maps import write_map

FILE = """
3 100 80 0.5 1.0 -2.0
0 10 20 1
1 E 40
1 50 20 2
0 W 40
2 N 30
2 50 50 1
1 S 30
"""


def write_graph(folder: Path, text: str = FILE) -> Path:
    (folder / "some.graph").write_text(text, encoding="utf-8")
    return folder / "some.graph"


def random_graph(seed: int) -> Graph:
    """A connected graph of up to twelve vertices."""
    dice = np.random.default_rng(seed)
    size = int(dice.integers(1, 13))
    places = [(float(x), float(y)) for x, y in dice.random((size, 2)) * 50.0]
    pairs = {(int(dice.integers(0, vertex)), vertex) for vertex in range(1, size)}
    for _ in range(int(dice.integers(0, 10))):
        first, last = sorted(dice.integers(0, size, 2).tolist())
        if first != last:
            pairs.add((first, last))
    return graph_of(places, [(a, b, float(dice.integers(1, 30))) for a, b in sorted(pairs)])


def dijkstra(graph: Graph, start: int) -> list[float]:
    away, heap = [math.inf] * graph.size, [(0.0, start)]
    while heap:
        length, vertex = heapq.heappop(heap)
        if away[vertex] <= length:
            continue
        away[vertex] = length
        for other, way in graph.edges[vertex]:
            heapq.heappush(heap, (length + way, other))
    return away


@given(seed=st.integers(0, 2**32 - 1))
def test_lengths_and_ways_are_the_shortest(seed: int) -> None:
    graph = random_graph(seed)
    for start in range(graph.size):
        assert graph.lengths[start].tolist() == dijkstra(graph, start)
        for goal in range(graph.size):
            way = [start, *graph.way(start, goal)]
            assert way[-1] == goal
            steps = [dict(graph.edges[a])[b] for a, b in itertools.pairwise(way)]
            assert sum(steps) == graph.lengths[start, goal]


@given(seed=st.integers(0, 2**32 - 1))
def test_a_tour_of_few_vertices_is_nearly_the_shortest(seed: int) -> None:
    graph = random_graph(seed)
    some = list(range(0, graph.size, 2))
    tour = closed_tour(graph, some)
    assert sorted(tour) == some
    assert tour[0] == 0
    if len(some) <= 6:
        orders = ([0, *order] for order in itertools.permutations(some[1:]))
        assert tour_length(graph, tour) <= 1.25 * min(tour_length(graph, order) for order in orders) + 1e-9


def test_vertices_beside_a_stretch_are_found() -> None:
    graph = graph_of([(0.0, 0.0), (5.0, 0.3), (5.0, 0.5), (10.3, 0.0), (10.5, 0.0)], [])
    assert graph.within((0.0, 0.0), (10.0, 0.0), 0.4) == [1, 3]
    assert graph.within((10.0, 0.0), (0.0, 0.0), 0.4) == [1, 0], "in the order of the way"
    assert graph.within((5.0, 0.0), (5.0, 0.0), 0.4) == [1]
    assert graph.nearest(9.0, 1.0) == 3


def test_a_file_of_patrolling_sim_is_read_in_metres(tmp_path: Path) -> None:
    file = write_graph(tmp_path)
    vertices, edges = [(6.0, 8.0), (26.0, 8.0), (26.0, 23.0)], [(0, 1, 20.0), (1, 2, 15.0)]
    assert read_graph(file) == {"vertices": vertices, "edges": edges, "pixel": 0.5}
    spec = load_scenario({"terrain": {"builtin": "open", "graph": str(file)}}).terrain.graph
    assert spec is not None
    assert spec.edges == ((0, 1, 20.0), (1, 2, 15.0))


def test_the_distance_of_a_visit_can_be_set_and_leaves_the_hash_where_it_is_not(tmp_path: Path) -> None:
    file = write_graph(tmp_path)
    loaded = {
        name: load_scenario({"terrain": {"builtin": "open", "graph": given}, "point": 1.0})
        for name, given in (
            ("plain", str(file)),
            ("same", {"file": str(file), "visit": 0.4}),
            ("near", {"file": str(file), "visit": 0.25}),
        )
    }
    assert scenario_hash(loaded["plain"]) == scenario_hash(loaded["same"]) != scenario_hash(loaded["near"])
    assert prepare(loaded["plain"]).make_graph().visit_reach(0.5, 0.5) == 0.4
    near = prepare(loaded["near"]).make_graph()
    assert near.visit_reach(0.5, 0.5) == 0.25
    assert near.visit_reach(4.0, 0.5) == 1.0, "half a stride"


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("3 100", "three 100", "line 2: three: expected the number of vertices, a number"),
        ("3 100", "0 100", "line 2: 0: expected the number of vertices, a whole number from 1 to 2000"),
        ("0.5", "0", "line 2: 0: expected the resolution in m per pixel, above 0"),
        ("0.5", "nan", "line 2: nan: expected the resolution in m per pixel, a number"),
        ("1 E 40", "7 E 40", "line 4: 7: expected a neighbour's number, a whole number from 0 to 2"),
        ("1 E 40", "1 up 40", "line 4: expected a neighbour's direction: N NE E SE S SW W NW"),
        ("1 E 40", "0 E 40", "line 4: expected a neighbour other than the vertex itself, at a length above 0"),
        ("1 50 20 2", "2 50 20 2", "line 5: expected vertex 1: they stand in order"),
        ("1 S 30", "1 S", "ends where the length of an edge in pixels should be"),
        ("1 S 30", "1 S 30 5", "line 9: 5: more than the vertices above"),
    ],
)
def test_what_is_no_graph_is_one_line(tmp_path: Path, old: str, new: str, says: str) -> None:
    file = write_graph(tmp_path, FILE.replace(old, new, 1))
    with pytest.raises(BadInput, match=r"\A[^\n]*some\.graph: [^\n]*\Z") as error:
        read_graph(file)
    assert says in str(error.value)
    with pytest.raises(BadInput) as error:
        load_scenario({"terrain": {"builtin": "open", "graph": str(file)}})
    assert says in str(error.value)


def test_a_graph_of_another_image_than_the_maps_is_refused(tmp_path: Path) -> None:
    file = write_graph(tmp_path)
    width, height = (int(word) for word in FILE.split()[1:3])
    for size in ((width, height), (height, width)):
        plan = write_map(tmp_path, Image.new("L", size, 255), {"resolution": 0.5})
        says = {"terrain": {"map": str(plan), "graph": str(file)}}
        if size == (width, height):
            assert load_scenario(says).terrain.graph is not None
            continue
        with pytest.raises(BadInput, match=f"made for an image of {width} x {height} .*map's has {height} x {width};"):
            load_scenario(says)


RMF = """building_name: shop
levels:
  L1:
    lanes: [[0, 1, {speed_limit: 0.0}], [1, 0, {}], [1, 2, {}]]
    vertices: [[2.0, 3.0, {name: till}], [9.0, 3.0, {}], [9.0, 7.5, {}]]
"""
ROUTE = """{"type": "FeatureCollection", "features": [
{"type": "Feature", "properties": {"id": 7}, "geometry": {"type": "Point", "coordinates": [2.0, 3.0]}},
{"type": "Feature", "properties": {"id": 3}, "geometry": {"type": "Point", "coordinates": [9.0, 3.0]}},
{"type": "Feature", "properties": {"id": 5}, "geometry": {"type": "Point", "coordinates": [9.0, 7.5]}},
{"type": "Feature", "properties": {"id": 8, "startid": 7, "endid": 3}, "geometry": {"type": "MultiLineString"}},
{"type": "Feature", "properties": {"id": 9, "startid": 5, "endid": 3}, "geometry": {"type": "MultiLineString"}}]}
"""


@pytest.mark.parametrize(("name", "text"), [("0.yaml", RMF), ("route.geojson", ROUTE)])
def test_navigation_graphs_of_open_rmf_and_route_graphs_of_nav2_are_read(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text)
    spec = load_scenario({"terrain": {"builtin": "open", "graph": str(tmp_path / name)}}).terrain.graph
    assert spec is not None
    assert spec.vertices == ((2.0, 3.0), (9.0, 3.0), (9.0, 7.5))
    assert spec.edges == ((0, 1, 7.0), (1, 2, 4.5))


@pytest.mark.parametrize(
    ("text", "old", "new", "says"),
    [
        (RMF, "  L1:", "  L0: {}\n  L1:", "levels: has L0, L1; expected one, that of the map"),
        ("levels: {L1: {}}", "L1: {}", "", "levels: has none; expected one, that of the map"),
        (RMF, "building_name: shop", "lifts: {}", "is a building of Open-RMF's traffic editor, in pixels"),
        (RMF, "[2.0, 3.0,", "[true, 3.0,", "true or false instead of a number"),
        (RMF, "[1, 0, {}]", "[true, 0, {}]", "true or false instead of a number"),
        (RMF, "[1, 2, {}]", "[1, 3, {}]", "is no graph of lanes"),
        (RMF, "7.5", ".nan", "at most 1e+06 m away"),
        (RMF, "7.5, {}", "up, {}", "is no graph of lanes"),
        (RMF, "    lanes", "    ways", "is no graph of lanes"),
        (ROUTE, '"id": 3', '"id": 7', "have the same id"),
        (ROUTE, '"id": 3', '"id": [3]', "is no graph of lanes"),
        (ROUTE, '"Point", "coordinates": [9.0, 3.0]', '"Point"', "is no graph of lanes"),
        (ROUTE, '"startid": 7', '"startid": 1', "is no graph of lanes"),
        ("[1]", "1", "2", "expected the levels"),
    ],
)
def test_what_is_wrong_in_a_graph_of_lanes_is_one_line(
    tmp_path: Path, text: str, old: str, new: str, says: str
) -> None:
    file = tmp_path / "site.yaml"
    assert old in text
    file.write_text(text.replace(old, new, 1))
    with pytest.raises(BadInput, match=r"\A[^\n]*site\.yaml: [^\n]*\Z") as error:
        read_graph(file)
    assert says in str(error.value)


@given(st.binary(max_size=60))
def test_no_bytes_make_it_raise_anything_else(data: bytes) -> None:
    file = Path("/dev/shm" if Path("/dev/shm").is_dir() else "/tmp") / "fogwatch-fuzz.graph"
    file.write_bytes(b"2 1 1 1 0 0 0 1 1 1 1 E 5 " + data)
    try:
        read_graph(file)
    except BadInput:
        pass
    finally:
        file.unlink()


@pytest.mark.parametrize("terrain", ["open", "yards", "clutter"])
def test_all_of_the_ground_is_seen_from_the_vertices_made_from_it(terrain: str) -> None:
    prepared = prepare(load_scenario({"terrain": {"builtin": terrain}, "point": 1.0, "robots": {"count": 1}}))
    footprint, fields = sensor_footprint(prepared.scenario, prepared.terrain), prepared.fields[1]
    graph = graph_from_ground(prepared.terrain, fields, footprint)
    seen = np.zeros(prepared.terrain.shape, dtype=np.bool_)
    for x, y in graph.places.tolist():
        assert fields.reach[prepared.terrain.point_at(x, y)]
        seen |= on_terrain(footprint.visible(Pose(x, y, 0.0)), seen.shape)
    assert (seen | ~fields.patrolled).all()
    assert np.isfinite(graph.lengths).all()
    for vertex, row in enumerate(graph.edges):
        assert all(length >= 0.99 * math.dist(graph.places[vertex], graph.places[other]) for other, length in row)


def test_a_graph_of_another_terrain_is_refused() -> None:
    graph = {"vertices": [[5, 5], [500, 5]], "edges": [[0, 1, 495]]}
    scenario = load_scenario({"terrain": {"builtin": "open", "graph": graph}, "point": 1.0})
    with pytest.raises(BadInput, match=r"terrain\.graph: vertex 1 at \[500, 5\]: not on open; give the graph of this"):
        prepare(scenario)


@pytest.mark.parametrize("edge", [[0, 2, 1], [0, 0, 1], [-1, 0, 1], [0, 1, 0]])
def test_an_edge_joins_two_vertices(edge: list[int]) -> None:
    graph = {"vertices": [[5, 5], [10, 5]], "edges": [edge]}
    with pytest.raises(BadInput, match=r"terrain\.graph\.edges"):
        load_scenario({"terrain": {"builtin": "open", "graph": graph}})


def test_ground_that_one_narrow_view_covers_has_a_vertex(tmp_path: Path) -> None:
    """A place that sees what its own view shows, and is the post of what it does not, is one place."""
    plan = write_map(tmp_path, Image.new("L", (7, 6), 255), {"resolution": 0.5})
    robots = {"count": 1, "model": "holonomic", "radius": 0.05}
    sensor = {"range": 99.0, "angle": 90.0}
    given = {"terrain": {"map": str(plan)}, "point": 0.5, "robots": robots, "sensor": sensor}
    assert len(prepare(load_scenario(given)).make_graph().places) >= 1
