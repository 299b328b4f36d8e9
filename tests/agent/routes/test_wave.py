"""The wave against scipy's Dijkstra and against its own rules in plain Python, and the bearings of its paths."""

from collections import deque

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from agent.kernels import wave as kernel
from agent.kernels.wave import FAR, HEMMED, SETTLED, STATUS
from agent.routes.ground import Ground
from agent.routes.wave import Wave, box_around, box_between, paths_in
from patrol.ground.terrain import Terrain
from patrol.kernels.footprint import cast
from patrol.scenario.policies import Ties
from tests.agent.plans import cluttered

# Not the product's own, so that a wrong one there is noticed.
ROOM = 2**12

Bools = NDArray[np.bool_]
Drawn = tuple[int, int, int, float]


def dijkstra_lengths(is_open: Bools, row: int, col: int) -> NDArray[np.float64]:
    """Path lengths in hundredths of a point by an independent implementation; infinity where there is no path."""
    index = np.arange(is_open.size).reshape(is_open.shape)
    tails, heads, costs = [], [], []
    for dr, dc, cost in ((0, 1, 100), (1, 0, 100), (1, 1, 141), (1, -1, 141)):
        for r, c in np.argwhere(is_open):
            to = (r + dr, c + dc)
            if not (0 <= to[0] < is_open.shape[0] and 0 <= to[1] < is_open.shape[1]) or not is_open[to]:
                continue
            if cost == 141 and not (is_open[r, to[1]] and is_open[to[0], c]):
                continue
            tails.append(index[r, c])
            heads.append(index[to])
            costs.append(cost)
    ends = (np.array(tails, dtype=np.int64), np.array(heads, dtype=np.int64))
    graph = csr_array((np.array(costs, dtype=np.float64), ends), shape=(is_open.size, is_open.size))
    lengths = dijkstra(graph, directed=False, indices=np.array([index[row, col]]))
    return lengths.reshape(is_open.shape)


def wave_from(is_open: Bools, row: int, col: int, span: int, limits: list[int]) -> Wave:
    height, width = is_open.shape
    ground = Ground(Terrain("t", is_open, 1.0), is_open)
    wave = Wave(height, width, span)
    wave.begin(ground, row + 1, col + 1)
    for limit in limits:
        wave.extend(limit)
    return wave


def over_terrain(wave: Wave, grid: NDArray[np.int32], shape: tuple[int, int]) -> NDArray[np.int64]:
    """The window's values laid over the terrain; -1 where no path is known."""
    out = np.full(shape, -1, dtype=np.int64)
    for i, j in np.argwhere(wave.state & STATUS == SETTLED):
        out[wave.row0 + i, wave.col0 + j] = grid[i, j]
    return out


SIDES_OF_MAPS, DENSITIES = st.integers(2, 32), st.sampled_from([0.0, 0.08, 0.25, 0.4])
maps = st.tuples(SIDES_OF_MAPS, SIDES_OF_MAPS, st.integers(0, 2**32 - 1), DENSITIES)


def random_map(values: Drawn) -> tuple[Bools, int, int]:
    height, width, seed, density = values
    rng = np.random.default_rng(seed)
    is_open = rng.random((height, width)) >= density
    row, col = int(rng.integers(height)), int(rng.integers(width))
    is_open[row, col] = True
    return is_open, row, col


PIECES = st.lists(st.integers(0, 3000), max_size=3)


@settings(max_examples=180)
@given(values=maps, pieces=PIECES, limit=st.one_of(st.none(), st.integers(0, 2000)))
def test_lengths_up_to_a_limit_equal_dijkstra(values: Drawn, pieces: list[int], limit: int | None) -> None:
    is_open, row, col = random_map(values)
    reference = dijkstra_lengths(is_open, row, col)
    last, span = (10**6, 40) if limit is None else (limit, -(-limit // 100) + 1)
    # In one go or in pieces, a wave comes to the same.
    wave = wave_from(is_open, row, col, span, [*sorted(piece for piece in pieces if piece < last), last])
    found = over_terrain(wave, wave.length, is_open.shape)
    known = np.isfinite(reference) & (reference <= last)
    assert np.array_equal(found, np.where(known, reference, -1))


@settings(max_examples=40)
@given(values=maps, ties=st.sampled_from(["straight", "drawn"]), key=st.integers(0, 2**53 - 1))
def test_the_first_step_is_on_a_shortest_path(values: Drawn, ties: Ties, key: int) -> None:
    is_open, row, col = random_map(values)
    wave = Wave(is_open.shape[0], is_open.shape[1], 40, ties)
    wave.begin(Ground(Terrain("t", is_open, 1.0), is_open), row + 1, col + 1, key=key)
    for limit in (700, 10**6):
        wave.extend(limit)
    steps = over_terrain(wave, wave.bend, is_open.shape)
    lengths = over_terrain(wave, wave.length, is_open.shape)
    for step in np.unique(steps[steps >= 0]):
        i, j = divmod(int(step), wave.state.shape[1])
        place = (i + wave.row0, j + wave.col0)
        assert max(abs(place[0] - row), abs(place[1] - col)) <= 1
        onward = dijkstra_lengths(is_open, *place)[steps == step]
        assert (lengths[place] + onward == lengths[steps == step]).all()


@settings(max_examples=40)
@given(values=maps, picks=st.lists(st.floats(0, 1, exclude_max=True), min_size=6, max_size=6))
def test_first_bends_are_in_sight_and_on_shortest_paths(values: Drawn, picks: list[float]) -> None:
    is_open, row, col = random_map(values)
    reference = dijkstra_lengths(is_open, row, col)
    wave = wave_from(is_open, row, col, 40, [10**6])
    cols = wave.state.shape[1]
    bends = over_terrain(wave, wave.bend, is_open.shape)
    known = np.argwhere(bends >= 0)
    for r, c in (known[int(pick * len(known))] for pick in picks):
        i, j = divmod(int(bends[r, c]), cols)
        bend = (i + wave.row0, j + wave.col0)
        across, up = abs(bend[1] - col), abs(bend[0] - row)
        assert reference[bend] == 100 * abs(across - up) + 141 * min(across, up)
        onward = dijkstra_lengths(is_open, *bend)[r, c]
        assert reference[bend] + onward == reference[r, c]


WAYS = ((0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, -1), (-1, 1))
SIDES = {4: (0, 1), 5: (2, 1), 6: (2, 3), 7: (0, 3)}


def plain_paths(wave: Wave) -> tuple[dict[tuple[int, int], int], dict[tuple[int, int], int]]:
    """Lengths, and directions of the last steps, point by point, nearest first, for a wave that has just begun.

    Two first-in first-out queues, for straight and for diagonal steps; of equally long paths, what is in the diagonal
    queue comes first, and whoever comes first to a point with the shortest path takes it.
    """
    start = wave.start_row, wave.start_col
    lengths, came = {start: 0}, {start: -1}
    settled: set[tuple[int, int]] = set()
    queues: tuple[deque[tuple[int, tuple[int, int], int]], ...] = deque([(0, start, -1)]), deque()
    while any(queues):
        straight, diagonal = queues
        first = diagonal if diagonal and not (straight and straight[0][0] < diagonal[0][0]) else straight
        far, here, last = first.popleft()
        if here in settled:
            continue
        settled.add(here)
        came[here] = last
        everywhere = last < 0 or bool(wave.state[here] & HEMMED)
        tried = range(8) if everywhere else (last,) if last < 4 else (*SIDES[last], last)
        for way in tried:
            (up, across), cost = WAYS[way], 100 if way < 4 else 141
            there = here[0] + up, here[1] + across
            beside = ((here[0] + up, here[1]), (here[0], here[1] + across)) if way > 3 else ()
            if not wave.state[there] & STATUS or not all(wave.state[point] & STATUS for point in beside):
                continue
            if far + cost < lengths.get(there, 10**9):
                lengths[there] = far + cost
                queues[way > 3].append((far + cost, there, way))
    return lengths, came


def plain_bends(wave: Wave, is_seen: NDArray[np.uint8]) -> dict[tuple[int, int], tuple[int, int]]:
    """First bends by `plain_paths`."""
    lengths, came = plain_paths(wave)
    bends = {}
    for here in sorted(lengths, key=lengths.__getitem__):
        up, across = abs(here[0] - wave.start_row), abs(here[1] - wave.start_col)
        direct = lengths[here] == 100 * abs(across - up) + 141 * min(across, up)
        if came[here] < 0 or (is_seen[here] and direct):
            bends[here] = here
        else:
            (back, left) = WAYS[came[here]]
            bends[here] = bends[here[0] - back, here[1] - left]
    return bends


def walled_map(values: Drawn) -> tuple[Bools, int, int]:
    """As `random_map`, with walls and doors at equal distances, where many paths are equally long."""
    height, width, seed, density = values
    rng = np.random.default_rng(seed)
    is_open = np.ones((height, width), dtype=np.bool_)
    every = int(rng.integers(3, 9))
    is_open[every::every, :] = rng.random((len(range(every, height, every)), width)) < density
    is_open[:, every::every] |= rng.random((height, len(range(every, width, every)))) < density
    if seed % 2:
        is_open &= is_open[::-1]
    row, col = (height // 2, width // 2) if seed % 3 else (int(rng.integers(height)), int(rng.integers(width)))
    is_open[row, col] = True
    return is_open, row, col


@settings(max_examples=300)
@given(values=maps, walled=st.booleans(), pieces=PIECES, span=st.sampled_from([6, 17, 40]))
def test_of_equal_paths_the_plain_rules_first_one_counts(
    values: Drawn, walled: bool, pieces: list[int], span: int
) -> None:
    is_open, row, col = walled_map(values) if walled else random_map(values)
    height, width = is_open.shape
    wave = Wave(height, width, span)
    ground = Ground(Terrain("t", is_open, 1.0), is_open)
    wave.begin(ground, row + 1, col + 1)
    is_seen = np.zeros_like(wave.state)
    cast(wave.state, wave.start_row, wave.start_col, float(span), is_seen, 0, 0)
    bends = plain_bends(wave, is_seen)
    for limit in [*sorted(pieces), 10**6]:
        wave.extend(limit)
    known = {(int(i), int(j)) for i, j in np.argwhere(wave.state & STATUS == SETTLED)}
    assert known == set(bends)
    cols = wave.state.shape[1]
    assert {point: divmod(int(wave.bend[point]), cols) for point in known} == bends


def test_a_wave_with_too_little_room_makes_more() -> None:
    rng = np.random.default_rng(4)
    is_open = rng.random((700, 700)) >= 0.2
    is_open[350, 350] = True
    reference = dijkstra_lengths(is_open, 350, 350)
    wave = wave_from(is_open, 350, 350, 700, [3000, 10**6])
    lengths = over_terrain(wave, wave.length, is_open.shape)
    assert np.array_equal(lengths, np.where(np.isfinite(reference), reference, -1))
    ground = Ground(Terrain("t", is_open, 1.0), is_open)
    found = Wave(700, 700, 700).lengths_from(ground, 351, 351, [(351, 351)], 10**6)[1:-1, 1:-1]
    assert np.array_equal(found, np.where(np.isfinite(reference), reference, FAR))


def test_a_smaller_limit_than_before_changes_nothing() -> None:
    is_open, row, col = random_map((30, 32, 3, 0.25))
    once, again = (wave_from(is_open, row, col, 40, limits) for limits in ([1500], [1500, 400, 1500]))
    for grid in ("state", "length"):
        assert np.array_equal(getattr(once, grid), getattr(again, grid))
    known = once.state & STATUS == SETTLED
    assert known.any()
    assert np.array_equal(once.bend[known], again.bend[known])


@settings(max_examples=60)
@given(values=maps, limit=st.integers(0, 4000), count=st.integers(0, 4))
def test_lengths_from_several_starts_are_those_from_the_nearest(values: Drawn, limit: int, count: int) -> None:
    is_open, row, col = random_map(values)
    places = np.argwhere(is_open)
    starts = places[np.random.default_rng(values[2]).integers(0, len(places), count)].tolist()
    window = Wave(is_open.shape[0], is_open.shape[1], 10)
    ground = Ground(Terrain("t", is_open, 1.0), is_open)
    found = window.lengths_from(ground, row + 1, col + 1, [(r + 1, c + 1) for r, c in starts], limit)
    top, left, (height, width) = window.row0 + 1, window.col0 + 1, found.shape
    part = is_open[top : top + height - 2, left : left + width - 2]
    nearest = np.full(part.shape, np.inf)
    for r, c in starts:
        if 0 <= r - top < part.shape[0] and 0 <= c - left < part.shape[1]:
            nearest = np.minimum(nearest, dijkstra_lengths(part, r - top, c - left))
    assert np.array_equal(found[1:-1, 1:-1], np.where(nearest <= limit, nearest, FAR))
    assert (np.concatenate([found[0], found[-1], found[:, 0], found[:, -1]]) == FAR).all()


@pytest.mark.parametrize("seed", range(5))
def test_a_box_holds_the_lengths_of_paths_that_do_not_leave_it(seed: int) -> None:
    terrain = cluttered(seed, (60, 70), 40)
    ground, wave = Ground(terrain, terrain.passable), Wave(60, 70, 70)
    starts, limit = [(3, 4), (2, 66)], 2000
    whole = wave.lengths_from(ground, 4, 5, [(row + 1, col + 1) for row, col in starts], limit)
    paths = paths_in(ground, starts, (0, 26, 0, 70), limit)
    for row in range(24):
        for col in range(70):
            length = paths.length_to(row, col)
            assert length == whole[row + 1, col + 1] or (length == FAR and whole[row + 1, col + 1] > 2 * (25 - row))
    assert paths.length_to(40, 3) == FAR


def test_more_starts_than_there_is_room_for_take_more() -> None:
    terrain = cluttered(1, (400, 400), 0)
    ground = Ground(terrain, terrain.passable)
    starts = [(row, col) for row in range(0, 400, 4) for col in range(0, 400, 4)]
    assert len(starts) > ROOM
    paths = paths_in(ground, starts, (0, 400, 0, 400), 10_000)
    assert paths.length_to(1, 1) == 141
    assert paths.length_to(0, 396) == 0


def test_a_box_ends_where_the_terrain_does() -> None:
    assert box_around((5, 30), 10, (40, 35)) == (0, 16, 20, 35)


@pytest.mark.parametrize(
    ("steps", "box"), [(14, (7, 21, 8, 23)), (10, (9, 19, 10, 21)), (3, (10, 18, 10, 21)), (10**6, (0, 60, 0, 40))]
)
def test_a_box_between_two_points_holds_paths_of_some_steps(steps: int, box: tuple[int, int, int, int]) -> None:
    assert box_between((10, 20), (17, 10), steps, (60, 40)) == box


def test_kernel_and_windows_agree_on_what_is_far() -> None:
    """A kernel imports nothing of another file, so it has this number again."""
    assert kernel.FAR == FAR
