import heapq
import math
from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from patrol.ground.terrain import BoolGrid
from patrol.ground.ways import framed
from patrol.kernels.ways import FAR, is_clear, lengths_between, way_between
from tests.patrol.ground.lengths import lengths_along

Place = tuple[int, int]

seeds = st.integers(0, 2**32 - 1)

PLAN = """
#########
#...#...#
#.#.#.#.#
#.#...#.#
#########
"""
ROOM: BoolGrid = np.array([[letter == "." for letter in row] for row in PLAN.split()])


STEPS = [(up, across) for up in (-1, 0, 1) for across in (-1, 0, 1) if up or across]


def dijkstra(reach: BoolGrid, start: tuple[int, int]) -> NDArray[np.float64]:
    """Lengths of the ways from a point, in hundredths of a point, by the definition of a step."""
    lengths = np.full(reach.shape, np.inf)
    lengths[start] = 0
    heap = [(0, *start)]
    while heap:
        length, row, col = heapq.heappop(heap)
        for up, across in STEPS:
            to = row + up, col + across
            inside = 0 <= to[0] < reach.shape[0] and 0 <= to[1] < reach.shape[1]
            if not inside or not (reach[to] and reach[row, to[1]] and reach[to[0], col]):
                continue
            away = length + (141 if up and across else 100)
            if away < lengths[to]:
                lengths[to] = away
                heapq.heappush(heap, (away, *to))
    return lengths


def drawn(seed: int) -> tuple[BoolGrid, tuple[int, int]]:
    """A small random ground, and an open point."""
    rng = np.random.default_rng(seed)
    reach = rng.random(tuple(rng.integers(2, 14, 2))) < rng.choice([0.6, 0.9, 1.0])
    start = int(rng.integers(reach.shape[0])), int(rng.integers(reach.shape[1]))
    reach[start] = True
    return reach, start


def way(reach: BoolGrid, first: Place, last: Place) -> list[Place]:
    """Rows and columns of the corners of the way from one point to another; none where no way leads."""
    is_open = framed(reach)
    length = np.full(is_open.shape, FAR, dtype=np.int32)
    scratch = length, np.empty((2, is_open.size, 2), dtype=np.int32), np.empty(is_open.size, dtype=np.int32)
    begin, end = ((row + 1) * is_open.shape[1] + col + 1 for row, col in (first, last))
    count = way_between(is_open, begin, end, *scratch)
    assert (length == FAR).all()
    rows, cols = np.divmod(scratch[2][:count], is_open.shape[1])
    return list(zip((rows - 1).tolist(), (cols - 1).tolist(), strict=True))


@given(seeds)
@settings(max_examples=60)
def test_lengths_are_those_of_dijkstra(seed: int) -> None:
    reach, start = drawn(seed)
    expected = dijkstra(reach, start)
    lengths = lengths_along(reach, [start], FAR)
    assert np.array_equal(np.where(lengths < FAR, lengths, np.inf)[1:-1, 1:-1], expected)


@given(seeds)
@settings(max_examples=60)
def test_from_the_nearest_of_several_points_and_up_to_a_limit(seed: int) -> None:
    reach, start = drawn(seed)
    other = divmod(int(np.flatnonzero(reach)[-1]), reach.shape[1])
    expected = np.minimum(dijkstra(reach, start), dijkstra(reach, other))
    lengths = lengths_along(reach, [start, other], 450)[1:-1, 1:-1]
    assert np.array_equal(np.where(lengths < FAR, lengths, np.inf), np.where(expected <= 450, expected, np.inf))


@given(seeds)
@settings(max_examples=60)
def test_a_way_is_straight_from_corner_to_corner_over_open_points(seed: int) -> None:
    reach, start = drawn(seed)
    lengths = dijkstra(reach, start)
    for row, col in np.argwhere(np.isfinite(lengths))[::3].tolist():
        corners = way(reach, start, (row, col))
        assert (corners[0], corners[-1]) == (start, (row, col))
        for first, last in pairwise(corners):
            up, across = last[0] - first[0], last[1] - first[1]
            samples = np.linspace(0.0, 1.0, 40 * max(abs(up), abs(across)) + 1)[1:-1]
            rows = np.rint(first[0] + samples * up).astype(int)
            cols = np.rint(first[1] + samples * across).astype(int)
            assert reach[rows, cols].all()
        length = sum(math.dist(first, last) for first, last in pairwise(corners))
        assert length <= lengths[row, col] / 141.0 * math.sqrt(2.0) + 1e-9


def lengths(places: list[int], limit: int = 10**6) -> tuple[int, NDArray[np.int32]]:
    found = np.empty((len(places), len(places)), dtype=np.int32)
    return lengths_between(ROOM.view(np.uint8), np.array(places, dtype=np.int64), limit, found), found


def test_lengths_cut_no_corner_and_lead_through_other_places_beyond_the_limit() -> None:
    missing, found = lengths([10, 16, 28])
    assert missing == 0
    assert found.tolist() == [[0, 1000, 200], [1000, 0, 1200], [200, 1200, 0]]
    missing, found = lengths([10, 16, 30], 700)
    assert missing == 0
    assert found[0, 1] == found[0, 2] + found[2, 1] == 1000
    assert lengths([10, 16], 700)[0] == 2


def test_a_way_is_straight_where_it_can_be_and_else_turns_round_corners() -> None:
    start = 1, 1
    assert way(ROOM, start, start) == [start, start]
    assert way(ROOM, start, (1, 3)) == [start, (1, 3)]
    assert way(ROOM, start, (3, 1)) == [start, (3, 1)]
    assert way(ROOM, start, (1, 7)) == [start, (1, 3), (3, 3), (3, 5), (1, 5), (1, 7)]
    apart = ROOM.copy()
    apart[3, 4] = False
    assert way(apart, (1, 1), (1, 7)) == []


def test_a_line_through_a_corner_needs_all_four_points() -> None:
    open_ = np.ones((4, 4), dtype=np.bool_)
    assert is_clear(open_.view(np.uint8), 0, 15)
    open_[1, 2] = False
    assert not is_clear(open_.view(np.uint8), 0, 15)
    assert is_clear(open_.view(np.uint8), 0, 12)
    assert not is_clear(open_.view(np.uint8), 0, 6)


def test_a_way_as_long_as_the_limit_is_found_and_a_longer_one_is_not() -> None:
    field: BoolGrid = np.ones((4, 4), dtype=np.bool_)
    lengths = lengths_along(field, [(0, 0)], 241)[1:-1, 1:-1]
    assert lengths.tolist() == [[0, 100, 200, FAR], [100, 141, 241, FAR], [200, 241, FAR, FAR], [FAR] * 4]
