"""A map's YAML file: what is copied says the same, and its meaning does not depend on where it lies."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from patrol.errors import BadInput
from patrol.maps.cells import free_cells, image_size, read_image
from patrol.maps.map_file import map_meaning, read_map_file
from tests.patrol.maps.test_maps import write_map

PLAN = Image.fromarray(np.array([[254, 0, 205], [100, 254, 0]], dtype=np.uint8))


@pytest.mark.parametrize("turns", range(-1, 4))
@pytest.mark.parametrize("negate", [0, 1])
@pytest.mark.parametrize("mode", ["trinary", "scale", "raw"])
def test_a_copy_means_the_same(tmp_path: Path, turns: int, negate: int, mode: str) -> None:
    says = {"origin": [-1.5, 2.25, turns * math.pi / 2], "negate": negate, "mode": mode, "free_thresh": 0.4}
    path = write_map(tmp_path, PLAN, says)
    copy = tmp_path / "copy"
    copy.mkdir()
    read_map_file(path).copy_to(copy)
    assert sorted(file.name for file in copy.iterdir()) == ["plan.pgm", "plan.yaml"]
    again = read_map_file(copy / "plan.yaml")
    assert (again.turns, again.origin, again.negate, again.mode) == (turns % 4, (-1.5, 2.25), bool(negate), mode)
    assert (again.resolution, again.free_thresh, again.occupied_thresh) == (0.1, 0.4, 0.65)
    assert map_meaning(copy / "plan.yaml") == map_meaning(path)
    assert np.array_equal(free_cells(again), free_cells(read_map_file(path)))
    assert image_size(again) == read_image(again).greys.shape == ((2, 3) if turns % 2 == 0 else (3, 2))


CHANGES: list[dict[str, Any]] = [
    {"resolution": 0.2},
    {"origin": [1.0, 0.0, 0.0]},
    {"origin": [0.0, 1.0, 0.0]},
    {"origin": [0.0, 0.0, math.pi / 2]},
    {"origin": [0.0, 0.0, -math.pi / 2]},
    {"negate": 1},
    {"occupied_thresh": 0.7},
    {"free_thresh": 0.2},
    {"mode": "raw"},
]


def test_each_setting_and_the_image_are_parts_of_the_meaning(tmp_path: Path) -> None:
    meanings = [repr(map_meaning(write_map(tmp_path, PLAN, changes))) for changes in [{}, *CHANGES]]
    meanings.append(repr(map_meaning(write_map(tmp_path, PLAN.transpose(Image.Transpose.FLIP_LEFT_RIGHT)))))
    assert len(set(meanings)) == len(meanings)
    (tmp_path / "elsewhere").mkdir()
    assert repr(map_meaning(write_map(tmp_path / "elsewhere", PLAN))) == meanings[0]


@pytest.mark.parametrize(
    ("turns", "corner"), [(0, (10.0, 20.0)), (1, (8.0, 20.0)), (2, (7.0, 18.0)), (3, (10.0, 17.0))]
)
def test_the_lower_left_corner_is_that_of_the_turned_image(
    tmp_path: Path, turns: int, corner: tuple[float, float]
) -> None:
    """An image of 3 x 2 m turns about its own lower left corner, which stays at (10, 20)."""
    says = read_map_file(write_map(tmp_path, PLAN, {"resolution": 1.0, "origin": [10.0, 20.0, turns * math.pi / 2]}))
    assert says.corner(*image_size(says)) == corner


def test_map_and_image_must_lie_within_the_folder_that_is_given(tmp_path: Path) -> None:
    folder = tmp_path / "inner"
    folder.mkdir()
    inner, outer = write_map(folder, PLAN), write_map(tmp_path, PLAN)
    assert read_map_file(inner, folder).image == folder / "plan.pgm"
    with pytest.raises(BadInput, match="this map lies outside of"):
        read_map_file(outer, folder)
    inner.write_text(inner.read_text().replace("plan.pgm", "../plan.pgm"))
    (folder / "plan.pgm").unlink()
    with pytest.raises(BadInput, match=r'image = "\.\./plan\.pgm": lies outside of'):
        read_map_file(inner, folder)
    assert read_map_file(inner).image.resolve() == tmp_path / "plan.pgm"


@pytest.mark.parametrize("free", [0.0, 0.65])
def test_thresholds_may_be_equal_and_at_their_ends(tmp_path: Path, free: float) -> None:
    says = read_map_file(write_map(tmp_path, PLAN, {"free_thresh": free, "occupied_thresh": max(free, 1.0 - free)}))
    assert says.free_thresh == free
    with pytest.raises(BadInput, match="expected 0 <= free_thresh <= occupied_thresh <= 1"):
        read_map_file(write_map(tmp_path, PLAN, {"free_thresh": 0.651}))
