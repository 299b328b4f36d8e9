"""The wave against scipy's Dijkstra, and the bearings of its paths."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from agent.routes.ground import Ground
from agent.routes.kernels.wave import SETTLED, STATUS
from agent.routes.wave import Wave
from patrol.ground.terrain import Terrain

Bools = NDArray[np.bool_]


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


maps = st.tuples(
    st.integers(2, 32), st.integers(2, 32), st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.08, 0.25, 0.4])
)


def random_map(values: tuple[int, int, int, float]) -> tuple[Bools, int, int]:
    height, width, seed, density = values
    rng = np.random.default_rng(seed)
    is_open = rng.random((height, width)) >= density
    row, col = int(rng.integers(height)), int(rng.integers(width))
    is_open[row, col] = True
    return is_open, row, col


@settings(max_examples=120)
@given(values=maps, pieces=st.lists(st.integers(0, 3000), max_size=3))
def test_lengths_equal_dijkstra_to_the_last_unit(values: tuple[int, int, int, float], pieces: list[int]) -> None:
    is_open, row, col = random_map(values)
    reference = dijkstra_lengths(is_open, row, col)
    # In one go or in pieces, a wave comes to the same.
    wave = wave_from(is_open, row, col, 40, [*sorted(pieces), 10**6])
    lengths = over_terrain(wave, wave.length, is_open.shape)
    assert np.array_equal(lengths, np.where(np.isfinite(reference), reference, -1))


@settings(max_examples=60)
@given(values=maps, limit=st.integers(0, 2000))
def test_a_limit_settles_just_the_shorter_paths(values: tuple[int, int, int, float], limit: int) -> None:
    is_open, row, col = random_map(values)
    reference = dijkstra_lengths(is_open, row, col)
    wave = wave_from(is_open, row, col, -(-limit // 100) + 1, [limit])
    lengths = over_terrain(wave, wave.length, is_open.shape)
    assert np.array_equal(lengths, np.where(reference <= limit, reference, -1))


@settings(max_examples=40)
@given(values=maps, picks=st.lists(st.floats(0, 1, exclude_max=True), min_size=6, max_size=6))
def test_the_first_bend_is_in_sight_and_on_a_shortest_path(
    values: tuple[int, int, int, float], picks: list[float]
) -> None:
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


def test_on_an_open_field_each_of_eight_sectors_collects_its_bearings() -> None:
    is_open = np.ones((61, 61), dtype=np.bool_)
    wave = wave_from(is_open, 30, 30, 60, [10**6])
    bends = over_terrain(wave, wave.bend, is_open.shape)
    for r, c in np.ndindex(61, 61):
        i, j = divmod(int(bends[r, c]), wave.state.shape[1])
        assert (i + wave.row0, j + wave.col0) == (r, c)


def test_behind_a_wall_the_path_leads_through_its_door() -> None:
    is_open = np.ones((40, 60), dtype=np.bool_)
    is_open[:, 30] = False
    is_open[5:9, 30] = True
    wave = wave_from(is_open, 20, 10, 80, [10**6])
    bends = over_terrain(wave, wave.bend, is_open.shape)
    i, j = divmod(int(bends[30, 50]), wave.state.shape[1])
    bearing = math.atan2(i + wave.row0 - 20, j + wave.col0 - 10)
    door = [math.atan2(r - 20, 30 - 10) for r in (5, 8)]
    assert door[0] - 0.05 <= bearing <= door[1] + 0.05
