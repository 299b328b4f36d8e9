"""The grounds of benchmarks: the same each time, passable all round, and read back as they were written."""

from pathlib import Path

import numpy as np
import pytest

from bench.grounds import GAP, GROUNDS, KILOMETRE, square, tiled, write_map
from patrol.ground.cspace import parts_of
from patrol.maps.builtins import builtin_terrain
from patrol.prepare import prepare
from patrol.scenario import load_scenario


def test_the_square_kilometre_is_the_same_each_time_and_has_all_its_obstacles() -> None:
    passable = square()
    assert passable.shape == (KILOMETRE, KILOMETRE)
    assert np.array_equal(passable, square())
    assert not np.array_equal(passable, square(seed=1))
    _, obstacles = parts_of(~passable)
    assert obstacles == 250
    _, parts = parts_of(passable)
    assert parts == 1
    assert passable[:GAP].all()
    _, fewer = parts_of(~square(side=200))
    assert fewer == 10


@pytest.mark.parametrize("name", GROUNDS)
def test_waves_start_on_open_points(name: str) -> None:
    is_open, start = GROUNDS[name]()
    assert name.endswith(f"of {is_open.shape[0]} x {is_open.shape[1]} points")
    assert is_open[start]


def test_four_tiles_are_four_times_the_terrain() -> None:
    one = builtin_terrain("yards", 1.0).passable
    four = tiled("yards", 1.0)
    height, width = one.shape
    assert four.shape == (2 * height, 2 * width)
    assert np.array_equal(four[height:, :width], one)


def test_a_map_is_read_as_it_was_written(tmp_path: Path) -> None:
    passable = square(side=150)
    passable[0, 0] = False  # rows and columns would else look alike
    path = write_map(passable, 1.0, tmp_path / "ground.yaml")
    given = {"terrain": {"map": str(path)}, "point": 1.0, "robots": {"count": 1, "model": "holonomic"}}
    assert np.array_equal(prepare(load_scenario(given)).terrain.passable, passable)
