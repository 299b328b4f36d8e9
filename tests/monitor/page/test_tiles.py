import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from monitor.kernels.maps import KEEP
from monitor.page.maps import SIDE, TiledMap, terrain_packet

SHAPE = (SIDE + 9, 2 * SIDE + 5)


def unpack(packet: bytes, shown: NDArray[np.int32]) -> tuple[int, int, int, int]:
    """Do as the page does with a packet; return its layer, tick, since when it is known, and number of tiles."""
    layer, tick, since, tiles, runs = np.frombuffer(packet, "<i4", 5).tolist()
    ids, counts = np.frombuffer(packet, "<i4", 2 * tiles, 20).reshape(2, tiles)
    values = np.frombuffer(packet, "<i4", runs, 20 + 8 * tiles)
    lengths = np.frombuffer(packet, "<u2", runs, 20 + 8 * tiles + 4 * runs)
    assert len(packet) == 20 + 8 * tiles + 6 * runs
    across = -(-shown.shape[1] // SIDE)
    run = 0
    for tile, count in zip(ids.tolist(), counts.tolist(), strict=True):
        row, col = tile // across * SIDE, tile % across * SIDE
        part = shown[row : row + SIDE, col : col + SIDE]
        said = np.repeat(values[run : run + count], lengths[run : run + count]).reshape(part.shape)
        np.copyto(part, said, where=said != KEEP)
        run += count
    assert run == runs
    return layer, tick, since, tiles


Change = tuple[int, int, int, int, int]
corner = st.tuples(*(st.integers(*ends) for ends in ((0, SHAPE[0] - 1), (0, SHAPE[1] - 1), (1, 40), (1, 90), (-1, 9))))


@given(turns=st.lists(st.tuples(st.lists(corner, max_size=3), st.booleans()), min_size=1, max_size=8))
def test_whoever_looks_however_often_sees_the_map(turns: list[tuple[list[Change], bool]]) -> None:
    tiled = TiledMap(3, SHAPE)
    now: NDArray[np.int32] = np.full(SHAPE, -1, dtype=np.int32)
    keen, lazy = (np.full(SHAPE, -1, dtype=np.int32) for _ in range(2))
    had = {"keen": 0, "lazy": 0}
    for tick, (changes, looks) in enumerate(turns):
        for row, col, high, wide, value in changes:
            now[row : row + high, col : col + wide] = value
        tiled.update(now, tick)
        for name, shown in (("keen", keen), ("lazy", lazy)):
            if name == "keen" or looks:
                layer, of, since, tiles = unpack(tiled.packet(had[name], 7), shown)
                assert (layer, of, since) == (3, tick, 7)
                assert (tiles == 0) == (had[name] == tiled.version)
                had[name] = tiled.version
                np.testing.assert_array_equal(shown, now)


def test_only_what_changed_is_sent() -> None:
    tiled = TiledMap(0, SHAPE)
    now: NDArray[np.int32] = np.zeros(SHAPE, dtype=np.int32)
    tiled.update(now, 0)
    before = tiled.version
    now[3:9, 4:20] = 1
    tiled.update(now, 1)
    packet = tiled.packet(before)
    assert len(packet) < 200
    assert unpack(packet, np.zeros(SHAPE, dtype=np.int32)) == (0, 1, 0, 1)
    tiled.update(now, 2)
    packet = tiled.packet(tiled.version)
    assert len(packet) == 20
    assert unpack(packet, now) == (0, 2, 0, 0)


def test_a_terrain_needs_a_point() -> None:
    walls = np.zeros(SHAPE, dtype=np.bool_)
    assert terrain_packet(walls, walls)
    with pytest.raises(ValueError, match="points"):
        terrain_packet(np.zeros((0, 0), dtype=np.bool_), np.zeros((0, 0), dtype=np.bool_))
