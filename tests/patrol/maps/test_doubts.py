"""Doubts about a map are raised from a documented share, grey or factor on: at it and just beside it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from patrol.errors import BadInput
from patrol.maps.cells import read_image
from patrol.maps.doubts import doubts, perhaps_unknown, settings_text
from patrol.maps.load import read_terrain
from patrol.maps.map_file import read_map_file
from tests.patrol.maps.test_maps import doubts_of, write_map


def picture(side: int, rest: int, counts: dict[int, int]) -> NDArray[np.uint8]:
    """A square of some cells of each of some greys, row by row, and the rest of another."""
    greys = [grey for grey, count in counts.items() for _ in range(count)]
    return np.array(greys + [rest] * (side * side - len(greys)), dtype=np.uint8).reshape(side, side)


@pytest.mark.parametrize("negate", [0, 1])
@pytest.mark.parametrize(
    ("rest", "counts", "doubted"),
    [
        (254, {216: 100}, True),  # occupancy 0.153 on 1 % of 10 000 free cells
        (254, {216: 99}, False),
        (254, {217: 5000}, False),  # 0.149: light enough
        (254, {210: 300, 205: 100}, True),  # 1 % are the saver's unknown, so that it may be by chance
        (254, {210: 300, 205: 101}, False),
        (0, {254: 990, 216: 10}, True),  # of the free cells, not of all
        (0, {254: 990, 216: 9}, False),
    ],
)
def test_dark_greys_are_doubted_from_one_percent_of_the_free_cells_on(
    tmp_path: Path, negate: int, rest: int, counts: dict[int, int], doubted: bool
) -> None:
    greys = picture(100, rest, counts)
    found = doubts_of(tmp_path, 255 - greys if negate else greys, negate=negate)
    assert [("as free" in doubt) for doubt in found] == [True] * doubted
    terrain = read_terrain(tmp_path / "plan.yaml", 0.1)
    dark = next(grey for grey in counts if grey != 254)
    assert np.count_nonzero(perhaps_unknown(terrain)) == counts[dark] * doubted


@pytest.mark.parametrize("negate", [0, 1])
@pytest.mark.parametrize(
    ("blocks", "words"),
    [
        ({189: 50}, ""),  # 17 greys below the lightest that is not free
        ({190: 1}, "0.0 m² read as free and 0.6 m² read as not free"),
        ({221: 2}, "1.3 m² read as free and 0.0 m² read as not free"),
        ({222: 50}, ""),
        ({190: 3, 221: 2}, "1.3 m² read as free and 1.9 m² read as not free"),
    ],
)
def test_greys_of_a_jpeg_are_unsure_within_16_of_the_threshold(
    tmp_path: Path, negate: int, blocks: dict[int, int], words: str
) -> None:
    """Blocks of 8 x 8 cells of one grey, which a JPEG keeps; 206 is the darkest grey that is free."""
    greys = [grey for grey, count in blocks.items() for _ in range(count)]
    squares = np.array(greys + [254] * (100 - len(greys)), dtype=np.uint8).reshape(10, 10)
    cells = squares.repeat(8, axis=0).repeat(8, axis=1)
    kept = tmp_path / "kept.jpg"
    Image.fromarray(255 - cells if negate else cells).save(kept, quality=100)
    says = {"image": "plan.jpg", "negate": negate}
    found = doubts(read_terrain(write_map(tmp_path, kept.read_bytes(), says), 0.1))
    assert [doubt.partition(": a JPEG, which blurs greys: ")[2].partition(" lie")[0] for doubt in found] == (
        [words] if words else []
    )
    assert all(doubt.endswith("within 16 greys of free_thresh; export the map as PNG or PGM") for doubt in found)


DEFAULTS = "free_thresh: 0.196 and occupied_thresh: 0.65"


@pytest.mark.parametrize(
    ("counts", "says", "advice"),
    [
        ({10: 20, 254: 80}, {"mode": "raw"}, ""),  # four times as much would be free
        ({10: 20, 254: 81}, {"mode": "raw"}, "mode: trinary would make 20.2 % free"),
        ({10: 1, 254: 20}, {"mode": "raw"}, ""),  # 5 %, which is nearly nothing
        ({10: 1, 254: 21}, {"mode": "raw"}, "mode: trinary would make 5.2 % free"),
        (
            {255: 1, 243: 200},
            {"free_thresh": 0.0},
            "free_thresh: 0.196 and occupied_thresh: 0.65 would make 50.2 % free",
        ),
        ({255: 1, 242: 200}, {"free_thresh": 0.0}, ""),  # an occupancy of 0.051 is not white
    ],
)
def test_a_setting_is_advised_that_frees_more_than_four_times_as_much(
    tmp_path: Path, counts: dict[int, int], says: dict[str, Any], advice: str
) -> None:
    found = doubts_of(tmp_path, picture(20, 150, counts), **says)
    assert [doubt.rpartition(" (")[2].rstrip(")") for doubt in found] == ([advice] if advice else [])


@pytest.mark.parametrize(
    ("transparent", "white", "told"), [(200, 20, "50.0 %"), (199, 20, ""), (200, 21, ""), (379, 1, "94.8 %")]
)
def test_an_image_is_mostly_transparent_from_half_of_it_on_where_little_is_free(
    tmp_path: Path, transparent: int, white: int, told: str
) -> None:
    """Of 400 pixels, 5 % of which may be free."""
    pixels = np.zeros((400, 4), dtype=np.uint8)
    pixels[transparent:, 3] = 255
    pixels[400 - white :, :3] = 255
    path = write_map(tmp_path, Image.fromarray(pixels.reshape(20, 20, 4)), {"image": "plan.png"})
    told_all = (doubt.partition(" of its pixels are transparent") for doubt in doubts(read_terrain(path, 0.1)))
    shares = [before.rpartition("? ")[2] for before, found, _ in told_all if found]
    assert shares == ([told] if told else [])


@pytest.mark.parametrize(("share", "noted"), [(0.0101, True), (-0.0101, True), (0.0099, False), (-0.0099, False)])
def test_a_skew_is_noted_from_a_hundredth_of_a_pixel_over_the_longer_side_on(
    tmp_path: Path, share: float, noted: bool
) -> None:
    path = write_map(tmp_path, Image.new("L", (80, 20), 254), {"origin": [0.0, 0.0, share / 80]})
    assert [("counts as 0" in doubt) for doubt in doubts(read_terrain(path, 0.1))] == [True] * noted


def test_the_shares_are_of_all_cells_and_add_up(tmp_path: Path) -> None:
    greys = picture(10, 0, {254: 25, 150: 35, 205: 10})  # occupancies 0.004, 0.41 and 0.196; 30 are black
    says = read_map_file(write_map(tmp_path, Image.fromarray(greys)))
    assert settings_text(says, read_image(says)) == (
        "negate = false, mode = trinary, free_thresh = 0.196 and occupied_thresh = 0.65 make 25.0 % of its cells free, "
        "30.0 % occupied and 45.0 % unknown; correct negate, mode or the thresholds"
    )


@pytest.mark.parametrize(("wall", "inverted"), [(4, True), (20, False)])
def test_a_drawing_is_inverted_where_what_is_free_is_as_thin_as_walls(
    tmp_path: Path, wall: int, inverted: bool
) -> None:
    """A room whose walls are free as `negate` says: of thin ones nearly no cell has free ones all around."""
    greys = np.pad(np.full((60, 60), 254, dtype=np.uint8), wall)
    found = doubts_of(tmp_path, 255 - greys if not inverted else greys, negate=1)
    assert [("negate: 0 would make" in doubt) for doubt in found] == [True] * inverted


def test_a_map_without_a_free_cell_names_the_setting(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"leaves no free cell in plan\.pgm: .* make 0\.0 % of its cells free, 100"):
        read_terrain(write_map(tmp_path, Image.new("L", (9, 9), 0)), 0.1)
