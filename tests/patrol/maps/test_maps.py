import io
import math
import struct
import zlib
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from PIL import Image

from patrol.errors import BadInput
from patrol.ground.shapes import touched_points
from patrol.maps.cells import MapImage, free_cells, marked_cells, single_unknown_cells
from patrol.maps.doubts import doubts, perhaps_unknown
from patrol.maps.load import load_terrain, read_terrain
from patrol.maps.map_file import read_map_file
from patrol.scenario import TerrainSpec

SAYS: dict[str, Any] = {
    "image": "plan.pgm",
    "resolution": 0.1,
    "origin": [0.0, 0.0, 0.0],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}


def write_map(folder: Path, image: Image.Image | bytes, says: Mapping[str, Any] | None = None) -> Path:
    """A map of an image (or of a file's bytes) whose YAML has these keys changed, or left out where None."""
    merged = {key: value for key, value in {**SAYS, **(says or {})}.items() if value is not None}
    target = folder / str(merged.get("image", "plan.pgm"))
    if isinstance(image, bytes):
        target.write_bytes(image)
    else:
        image.save(target)
    path = folder / "plan.yaml"
    path.write_text(yaml.safe_dump(merged), encoding="utf-8")
    return path


def grey(*rows: list[int]) -> Image.Image:
    return Image.fromarray(np.array(rows, dtype=np.uint8))


WHITE = grey([254] * 4, [254] * 4, [254] * 4)


def free_of(folder: Path, picture: Image.Image | bytes, **says: Any) -> list[list[bool]]:
    """Free cells with the image's upper row first."""
    free: list[list[bool]] = free_cells(read_map_file(write_map(folder, picture, says)))[::-1].tolist()
    return free


@pytest.mark.parametrize(
    ("says", "greys", "free"),
    [
        # Occupancies 0.996, 0.35, 0.196 (205: the usual grey for unknown), 0.192, 0.004.
        ({}, [1, 166, 205, 206, 254], [False, False, False, True, True]),
        ({"negate": 1}, [0, 49, 50, 255], [True, True, False, False]),
        *(({"negate": negate}, [0, 255], [negate, not negate]) for negate in (True, False)),
        *(
            ({"mode": "raw"} | more, [0, 19, 20, 100, 101, 255], [True] * 2 + [False] * 4)
            for more in ({}, {"negate": 1})
        ),
    ],
)
def test_free_is_what_mode_negate_and_threshold_say(
    says: dict[str, Any], greys: list[int], free: list[bool], tmp_path: Path
) -> None:
    assert free_of(tmp_path, grey(greys), **says) == [free]


def test_the_images_lower_row_has_the_lowest_y(tmp_path: Path) -> None:
    terrain = read_terrain(write_map(tmp_path, grey([0, 0, 0], [0, 254, 254]), {"origin": [-3.0, 2.0, 0.0]}), 0.1)
    assert terrain.passable.tolist() == [[False, True, True], [False, False, False]]
    assert terrain.bounds == pytest.approx((-3.0, 2.0, -2.7, 2.2))
    assert terrain.name == "plan"


@pytest.mark.parametrize("mode", ["trinary", "scale"])
def test_what_is_not_opaque_is_unknown_and_opacity_is_no_part_of_the_grey(tmp_path: Path, mode: str) -> None:
    pixels = np.array([[[255, 255, 255, 255], [255, 255, 255, 254], [205, 205, 205, 255], [0, 0, 0, 0]]], np.uint8)
    assert free_of(tmp_path, Image.fromarray(pixels), image="plan.png", mode=mode) == [[True, False, False, False]]


def test_colours_weigh_in_the_grey_as_they_are_seen(tmp_path: Path) -> None:
    # 0.299 red, 0.587 green, 0.114 blue: greys 226, 105 and 179, and occupancies 0.11, 0.59 and 0.30.
    image = Image.fromarray(np.array([[[255, 255, 0], [255, 0, 255], [0, 255, 255]]], dtype=np.uint8))
    assert free_of(tmp_path, image, image="plan.png", free_thresh=0.25) == [[True, False, False]]


def test_the_thresholds_themselves_are_free_and_occupied(tmp_path: Path) -> None:
    image = grey([0, 51, 204, 255])  # occupancies 1, 0.8, 0.2 and 0
    thresholds = {"free_thresh": 0.2, "occupied_thresh": 0.8}
    assert free_of(tmp_path, image, **thresholds) == [[False, False, True, True]]
    assert marked_cells(read_map_file(tmp_path / "plan.yaml")).tolist() == [[True, True, False, False]]
    extremes = {"free_thresh": 0.0, "occupied_thresh": 1.0}
    assert free_of(tmp_path, image, **extremes) == [[False, False, False, True]]
    assert marked_cells(read_map_file(tmp_path / "plan.yaml")).tolist() == [[True, False, False, False]]
    assert free_of(tmp_path, image, free_thresh=0.5, occupied_thresh=0.5) == [[False, False, True, True]]


def test_a_yaml_file_may_hold_tabs_modes_in_capitals_and_whole_turns(tmp_path: Path) -> None:
    grey([0, 254]).save(tmp_path / "plan.pgm")
    path = tmp_path / "plan.yaml"
    path.write_text(
        "image:\tplan.pgm\t# as drawn\nresolution:\t0.05\norigin: [-1,\t2, 6.283185307179586]\nnegate: \toff\n"
        "occupied_thresh:\t0.65\nfree_thresh: 0.196\nmode:\tTrinary\n"
    )
    says = read_map_file(path)
    assert (says.origin, says.mode, says.negate) == ((-1.0, 2.0), "trinary", False)
    for yaw in ("1e-17", "-6.2832"):
        path.write_text(path.read_text().replace("6.283185307179586", yaw))
        assert free_cells(read_map_file(path)).tolist() == [[False, True]]


@pytest.mark.parametrize(
    ("yaw", "corner"),
    [(math.pi / 2, (0.8, 2.0)), (-math.pi, (0.7, 1.8)), (-1.5708, (1.0, 1.7)), (5 * math.pi / 2, (0.8, 2.0))],
)
def test_quarter_and_half_turns_turn_the_cells_about_the_origin(
    tmp_path: Path, yaw: float, corner: tuple[float, float]
) -> None:
    path = write_map(tmp_path, grey([254, 0, 0], [0, 0, 254]), {"origin": [1.0, 2.0, yaw]})
    terrain = read_terrain(path, 0.1)
    cells = free_cells(read_map_file(path))
    for row, col in ((0, 2), (1, 0)):  # the free cells of the image, the lowest row first
        across, up = 0.1 * (col + 0.5), 0.1 * (row + 0.5)
        x = 1.0 + across * math.cos(yaw) - up * math.sin(yaw)
        y = 2.0 + across * math.sin(yaw) + up * math.cos(yaw)
        assert terrain.passable[terrain.point_at(x, y)]
    assert np.count_nonzero(cells) == np.count_nonzero(terrain.passable) == 2
    assert terrain.origin == pytest.approx(corner)


def test_what_is_transparent_turns_with_the_map(tmp_path: Path) -> None:
    drawn = Image.new("RGBA", (3, 2), (255, 255, 255, 255))
    drawn.putpixel((0, 1), (255, 255, 255, 0))  # at the origin, about which a quarter turn to the left turns all
    path = write_map(tmp_path, drawn, {"image": "plan.png", "origin": [0.0, 0.0, math.pi / 2]})
    assert free_cells(read_map_file(path)).tolist() == [[True, False], [True, True], [True, True]]


@pytest.mark.parametrize("named", ["/maps/of/another/plan.pgm", "C:\\maps\\plan.pgm", "elsewhere/plan.pgm"])
def test_an_image_beside_the_yaml_file_is_read_where_the_named_one_is_missing(tmp_path: Path, named: str) -> None:
    path = write_map(tmp_path, Image.fromarray(WALLED))
    path.write_text(path.read_text().replace("plan.pgm", named))
    terrain = read_terrain(path, 0.1)
    assert terrain.passable.any()
    assert doubts(terrain) == [f"plan.yaml: image = {named}: no such file; plan.pgm beside it is read"]


def test_palettes_and_transparent_colours_are_read_as_what_they_show(tmp_path: Path) -> None:
    palette = Image.fromarray(np.array([[0, 1, 2]], dtype=np.uint8)).convert("P")
    palette.putpalette([255, 255, 255, 0, 0, 0, 128, 128, 128])
    palette.save(tmp_path / "opaque.png")
    assert free_of(tmp_path, (tmp_path / "opaque.png").read_bytes(), image="plan.png") == [[True, False, False]]
    palette.save(tmp_path / "clear.png", transparency=0)
    assert free_of(tmp_path, (tmp_path / "clear.png").read_bytes(), image="plan.png") == [[False, False, False]]


@pytest.mark.parametrize(
    "content",
    [
        b"P2\n# drawn by hand\n3 2\n# two comments\n255\n254 0 254\n0 254 254\n",
        b"P5\n# drawn by hand\n3 2\n255\n" + bytes([254, 0, 254, 0, 254, 254]),
        b"P5 3 2 65535\n" + np.array([65000, 0, 65000, 0, 65000, 65000], dtype=">u2").tobytes(),
        b"P2 3 2 65535 65000 0 65000 0 65000 65000",
        b"P5 3 2 100\n" + bytes([99, 0, 99, 0, 99, 99]),
    ],
    ids=["plain", "raw", "raw 16 bit", "plain 16 bit", "maxval 100"],
)
def test_every_kind_of_pgm(tmp_path: Path, content: bytes) -> None:
    assert free_of(tmp_path, content) == [[True, False, True], [False, True, True]]


def test_a_16_bit_png_is_read_in_256_greys(tmp_path: Path) -> None:
    image = Image.fromarray(np.array([[65535, 206 * 257, 206 * 257 - 1, 0]], dtype=np.uint16))
    assert free_of(tmp_path, image, image="plan.png") == [[True, True, False, False]]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1"])
def test_foreign_comments_and_a_missing_last_newline(tmp_path: Path, encoding: str) -> None:
    WHITE.save(tmp_path / "plan.pgm")
    path = tmp_path / "plan.yaml"
    path.write_text(
        "image: plan.pgm\nresolution: 5e-2\norigin: [-1, 2.5, 0.0]\nnegate: 0   # se negate=1 -> preto é livre\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.19",
        encoding=encoding,
    )
    says = read_map_file(path)
    assert (says.resolution, says.origin, says.negate, says.mode) == (0.05, (-1.0, 2.5), False, "trinary")
    assert says.image == tmp_path / "plan.pgm"


@settings(max_examples=150)
@given(
    cells=hnp.arrays(np.bool_, st.tuples(st.integers(1, 12), st.integers(1, 12))),
    resolution=st.sampled_from([0.05, 0.075, 0.1, 0.15, 0.25, 1.0 / 3.0, 0.4]),
    point=st.sampled_from([0.05, 0.1, 0.13, 0.2, 0.3, 0.7]),
)
def test_a_point_is_free_where_all_cells_under_it_are(cells: np.ndarray, resolution: float, point: float) -> None:
    height, width = (math.floor(count * resolution / point + 1e-6) for count in cells.shape)
    passable = ~touched_points(~cells, resolution, point, (height, width))

    def overlap(index: int, cell: int) -> float:
        return min((index + 1) * point, (cell + 1) * resolution) - max(index * point, cell * resolution)

    for (row, col), free in np.ndenumerate(passable):
        under = [
            cells[r, c]
            for r in range(cells.shape[0])
            for c in range(cells.shape[1])
            if overlap(row, r) > 1e-6 * resolution and overlap(col, c) > 1e-6 * resolution
        ]
        assert free == all(under)


def test_points_of_the_cells_size_are_the_cells() -> None:
    cells = np.random.default_rng(3).random((40, 70)) < 0.5
    for size in (0.05, 0.1, 0.3):
        assert np.array_equal(touched_points(cells, size, size, cells.shape), cells)


def test_large_maps_are_read_in_strips(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cells = np.where(np.random.default_rng(5).random((61, 40)) < 0.9, 254, 205).astype(np.uint8)
    path = write_map(tmp_path, Image.fromarray(cells), {"resolution": 0.03})
    whole = read_terrain(path, 0.1).passable
    monkeypatch.setattr("patrol.maps.load.CELLS_AT_ONCE", 1)
    monkeypatch.setattr("patrol.maps.load._LAST", {})
    assert np.array_equal(read_terrain(path, 0.1).passable, whole)


def test_single_unknown_cells_are_no_obstacles_unless_they_close_a_wall(tmp_path: Path) -> None:
    cells = np.array([[int(char) for char in row] for row in PLAN.split()])
    image = MapImage(np.array([0, 205, 254], dtype=np.uint8)[cells], None, False)
    specks = single_unknown_cells(image, read_map_file(write_map(tmp_path, WHITE)))
    assert np.argwhere(specks).tolist() == [[1, 1], [1, 6]]


PLAN = """
22222000
21222210
22222000
22222222
00010002
22222222
22211222
22221222
22222222
22122222
21222222
22222222
00000000
00010000
00000000
"""
"""Free ground 2, unknown 1, occupied 0. Specks: alone in the open, at a wall's end; not in a gap, a group or a wall."""


@pytest.mark.parametrize(
    ("says", "problem"),
    [
        *(({key: None}, f"{key}: missing") for key in SAYS),
        *(({"image": ""}, "image ="), ({"image": 5}, "image = 5")),
        *(({"resolution": value}, f"resolution = {value}") for value in (0, -0.1, [0.1])),
        *(({"resolution": math.nan}, "resolution = NaN"), ({"resolution": math.inf}, "resolution = Infinity")),
        *(({"resolution": "wide"}, 'resolution = "wide"'), ({"resolution": True}, "resolution = true")),
        *(({"resolution": 1e9}, "more than"), ({"resolution": 1e308}, "more than")),
        ({"resolution": 1e-9}, "less than one point"),
        *(({"origin": [0.0, 0.0]}, "origin ="), ({"origin": "here"}, "origin =")),
        *(
            ({"origin": [0.0, math.nan, 0.0]}, "origin = NaN"),
            ({"origin": [0.0, 0.0, 0.5]}, "a yaw of 0.5 rad is no quarter turn"),
        ),
        *(({"negate": 2}, "negate = 2"), ({"negate": "maybe"}, 'negate = "maybe"')),
        *(({"free_thresh": value}, f"free_thresh = {value}") for value in (0.7, -0.1)),
        *(({"free_thresh": math.nan}, "free_thresh = NaN"), ({"occupied_thresh": 1.5}, "occupied_thresh = 1.5")),
        *(({"mode": "trinity"}, "did you mean trinary"), ({"mode": 3}, "mode = 3")),
        *(({"negate": 1}, "leaves no free cell"), ({"free_thresh": 0.0}, "leaves no free cell")),
    ],
    ids=str,
)
def test_what_the_yaml_says_wrong_is_named(tmp_path: Path, says: dict[str, Any], problem: str) -> None:
    path = write_map(tmp_path, WHITE)
    merged = {key: value for key, value in {**SAYS, **says}.items() if value is not None}
    path.write_text(yaml.safe_dump(merged), encoding="utf-8")
    with pytest.raises(BadInput) as caught:
        read_terrain(path, 0.1)
    line = str(caught.value)
    assert problem in line
    assert line.startswith(str(path))
    assert "\n" not in line


def doubts_of(folder: Path, picture: NDArray[np.uint8], **says: Any) -> list[str]:
    return doubts(read_terrain(write_map(folder, Image.fromarray(picture), says), 0.1))


WALLED = np.pad(np.full((38, 38), 254, dtype=np.uint8), 1)
"""A room of 38 x 38 free cells with walls of one cell."""


@pytest.mark.parametrize(
    ("says", "words"),
    [
        (
            {"negate": 1},
            [
                "negate = true, mode = trinary, free_thresh = 0.196 and occupied_thresh = 0.65 make 9.8 % of",
                "90.2 % occupied and 0.0 % unknown; if the image shows something else, correct negate, mode",
                "or the thresholds (negate: 0 would make 90.2 % free)",
            ],
        ),
        (
            {"mode": "raw"},
            ["9.8 % of its cells free, 0.0 % occupied and 90.2 % unknown", "(mode: trinary would make 90.2 % free)"],
        ),
    ],
    ids=["negate", "mode"],
)
def test_settings_that_leave_only_the_walls_free_are_suspicious(
    tmp_path: Path, says: dict[str, Any], words: list[str]
) -> None:
    (doubt,) = doubts_of(tmp_path, WALLED, **says)
    assert [word for word in words if word not in doubt] == []
    assert doubts_of(tmp_path, WALLED) == []


def test_a_yaw_below_a_pixel_over_the_map_counts_as_none_and_is_noted(tmp_path: Path) -> None:
    (note,) = doubts_of(tmp_path, WALLED, origin=[0.0, 0.0, 0.99 / 40])
    assert "a yaw of 0.02475 rad counts as 0" in note
    with pytest.raises(BadInput, match=r"a yaw of 0\.025 rad is no quarter turn; rotate the image"):
        doubts_of(tmp_path, WALLED, origin=[0.0, 0.0, 1.0 / 40])


def test_greys_beside_a_savers_unknown_ground_are_only_the_rims_of_smoothing(tmp_path: Path) -> None:
    mapped = np.full((60, 60), 205, dtype=np.uint8)
    mapped[10:50, 10:50] = 254
    mapped[10, 10:50] = mapped[49, 10:50] = 210
    assert doubts_of(tmp_path, mapped) == []
    mapped[mapped == 205] = 0  # no unknown ground: the same greys are doubtful
    (doubt,) = doubts_of(tmp_path, mapped)
    assert "reads grey 210 as free" in doubt


def test_a_transparent_image_is_named_with_its_share_and_the_cure(tmp_path: Path) -> None:
    drawn = Image.new("RGBA", (20, 20), (0, 0, 0, 0))
    drawn.paste((0, 0, 0, 255), (0, 0, 20, 1))
    path = write_map(tmp_path, drawn, {"image": "plan.png"})
    with pytest.raises(BadInput, match=r"95\.0 % of its pixels are transparent, .* unknown; flatten it on white"):
        read_terrain(path, 0.1)


def test_unknown_ground_that_is_read_as_free_is_named_with_its_area_and_the_cure(tmp_path: Path) -> None:
    mapped = np.full((60, 60), 205, dtype=np.uint8)
    mapped[10:50, 10:50] = WALLED
    path = write_map(tmp_path, Image.fromarray(mapped), {"free_thresh": 0.25})
    terrain = read_terrain(path, 0.1)
    (doubt,) = doubts(terrain)
    assert "reads grey 205 as free: 20.0 m² of 34.4 m² free ground" in doubt
    assert doubt.endswith("set free_thresh: 0.196")
    assert np.count_nonzero(perhaps_unknown(terrain)) == 60 * 60 - 40 * 40
    assert doubts_of(tmp_path, mapped, free_thresh=0.25, mode="scale") == []
    corrected = read_terrain(write_map(tmp_path, Image.fromarray(mapped)), 0.1)
    assert doubts(corrected) == []
    assert not perhaps_unknown(corrected).any()


@pytest.mark.parametrize(
    ("white", "ending"),
    [
        (0, "but then only 0.0 m² would be free; if it is floor here, draw it white"),
        (3, "but then only 0.2 m² would be free; if it is floor here, draw it white"),
        (14, "if it does here, set free_thresh: 0.196"),
    ],
    ids=["grey floor", "grey floor with a speck", "small room in a large image"],
)
def test_a_cure_that_leaves_no_floor_is_not_advised(tmp_path: Path, white: int, ending: str) -> None:
    mapped = np.full((200, 200), 205, dtype=np.uint8)
    mapped[:white, : 2 * white] = 254
    (doubt,) = doubts_of(tmp_path, mapped, free_thresh=0.25)
    assert doubt.endswith(ending)


def test_dark_greys_that_are_few_each_and_many_together_are_named_with_a_cure_for_nearly_all(tmp_path: Path) -> None:
    mapped = np.full((100, 100), 254, dtype=np.uint8)
    greys = np.arange(192, 217, dtype=np.uint8)
    mapped[:25, :88] = greys[:, None]  # each on just under 1 % of the cells
    path = write_map(tmp_path, Image.fromarray(mapped), {"free_thresh": 0.25})
    terrain = read_terrain(path, 0.1)
    (doubt,) = doubts(terrain)
    assert "reads greys 192 to 216 as free: 22.0 m² of 100.0 m² free ground" in doubt
    assert doubt.endswith("set free_thresh: 0.152")
    assert np.count_nonzero(perhaps_unknown(terrain)) == 25 * 88
    mapped[:25, :88] = 205
    mapped[0, :10] = 216  # as few as a converter leaves at edges
    (doubt,) = doubts_of(tmp_path, mapped, free_thresh=0.25)
    assert "reads greys 205 to 216 as free" in doubt
    assert doubt.endswith("set free_thresh: 0.196")


def test_a_map_that_is_mostly_unknown_or_filled_around_is_read_without_doubt(tmp_path: Path) -> None:
    for around in (205, 0):
        mapped = np.full((200, 200), around, dtype=np.uint8)
        mapped[:40, :40] = WALLED
        assert doubts_of(tmp_path, mapped) == []


@pytest.mark.parametrize("around", [205, 0], ids=["unknown", "filled"])
def test_an_inverted_negate_is_noticed_where_walls_are_thick_too(tmp_path: Path, around: int) -> None:
    mapped = np.full((80, 80), around, dtype=np.uint8)
    mapped[10:70, 10:70] = 0
    mapped[20:60, 20:60] = 254
    (doubt,) = doubts_of(tmp_path, mapped, negate=1)
    assert "negate: 0 would make 25.0 % free" in doubt


@pytest.mark.parametrize("unknown", [50, 49])
def test_an_inverted_image_is_noticed_by_its_unknown_ground(tmp_path: Path, unknown: int) -> None:
    mapped = np.full((80, 80), unknown, dtype=np.uint8)
    mapped[10:70, 10:70] = 254
    mapped[20:60, 20:60] = 0
    (doubt,) = doubts_of(tmp_path, mapped, free_thresh=0.19)
    assert "negate: 1 would make 25.0 % free" in doubt
    mapped[10:70, 10:70] = 254  # a drawing whose walls have that grey
    for outside in (unknown, 0):
        mapped[:5] = mapped[-5:] = mapped[:, :5] = mapped[:, -5:] = outside
        assert doubts_of(tmp_path, mapped, free_thresh=0.25) == []


def test_too_coarse_points_are_not_blamed_where_the_settings_are(tmp_path: Path) -> None:
    wide = np.pad(np.full((398, 398), 254, dtype=np.uint8), 1)
    with pytest.raises(BadInput, match=r"no free point of 0\.2 m: negate = true.*make 1\.0 % of its cells free"):
        read_terrain(write_map(tmp_path, Image.fromarray(wide), {"negate": 1}), 0.2)
    with pytest.raises(BadInput, match=r"no free cell in plan\.pgm: .*free_thresh: 0\.196 .* make 99\.0 % free"):
        read_terrain(write_map(tmp_path, Image.fromarray(wide), {"free_thresh": 0.0}), 0.2)
    with pytest.raises(BadInput, match=r"no free point of 50 m; .*choose a smaller point"):
        read_terrain(write_map(tmp_path, Image.fromarray(wide), {"resolution": 0.15}), 50.0)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"P5\n40 30\n255\n" + bytes(600), "truncated"),
        (b"P5\n40 30\n65535\n" + bytes(600), "cannot be read"),
        (b"P2\n4 4\n255\n1 2 3", "cannot be read"),
        (b"P5\n40", "cannot be read"),
        (b"P5\n0 0\n255\n", "is not a PGM"),
        (b"P5\n999999 999999\n255\n", "pixels"),
        (b"", "is empty, not a PGM"),
        (b"just text", "is not a PGM"),
        (b"\x89PNG\r\n\x1a\n" + bytes(30), "is not a PGM"),
        (b"Pf\n2 1\n-1.0\n" + bytes(8), "floating-point pixels"),
    ],
    ids=lambda value: None if isinstance(value, str) else repr(value[:16]),
)
def test_an_image_that_is_none_is_named(tmp_path: Path, content: bytes, problem: str) -> None:
    with pytest.raises(BadInput, match=problem) as caught:
        read_terrain(write_map(tmp_path, content), 0.1)
    assert "plan.pgm" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("kind", "side"), [("P5", 20_001), ("P6", 10_001)])
def test_an_image_that_takes_too_much_memory_is_refused_with_ways_to_shrink_it(
    tmp_path: Path, kind: str, side: int
) -> None:
    path = write_map(tmp_path, f"{kind}\n{side} {side}\n255\n".encode(), {"resolution": 0.01})
    with pytest.raises(BadInput, match=f"{side} x {side} pixels, more than .*; crop it, .* 8-bit grey, or shrink it"):
        read_terrain(path, 0.1)


@settings(max_examples=150)
@given(
    kind=st.sampled_from(["PNG", "PPM", "BMP", "JPEG"]),
    cut=st.integers(0, 200),
    at=st.integers(0, 120),
    byte=st.integers(0, 255),
)
def test_a_damaged_image_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, kind: str, cut: int, at: int, byte: int
) -> None:
    sound = io.BytesIO()
    WHITE.save(sound, kind)
    content = bytearray(sound.getvalue())
    content[at % len(content)] = byte
    path = write_map(tmp_path_factory.mktemp("damaged"), bytes(content[: len(content) - cut]))
    with suppress(BadInput):
        assert free_cells(read_map_file(path)).size > 0


MEGABYTES = 4 << 20


def png(*chunks: bytes) -> bytes:
    """A PNG of 10 x 10 pixels with chunks before and after its pixels."""
    whole = io.BytesIO()
    Image.new("L", (10, 10)).save(whole, "PNG")
    end = len(whole.getvalue()) - 12
    head, body = whole.getvalue()[:33], whole.getvalue()[33:end]
    return b"".join((head, *chunks[:1], body, *chunks[1:], whole.getvalue()[end:]))


def jpeg(markers: bytes) -> bytes:
    """A JPEG of 10 x 10 pixels that begins with markers."""
    whole = io.BytesIO()
    Image.new("L", (10, 10)).save(whole, "JPEG")
    return whole.getvalue()[:2] + markers + whole.getvalue()[2:]


EMPTY_CHUNK = struct.pack(">I4sI", 0, b"abCd", zlib.crc32(b"abCd"))
LABORIOUS = {
    "a long comment": b"P5\n#" + b"x" * MEGABYTES + b"\n10 10\n255\n" + bytes(100),
    "a long gap": b"P5\n" + b"\n" * MEGABYTES + b"10 10\n255\n" + bytes(100),
    "comments between pixels": b"P2\n10 10\n255\n" + b"#\n" * MEGABYTES + b"0 " * 100,
    "chunks before the pixels": png(EMPTY_CHUNK * (MEGABYTES // 12)),
    "chunks after the pixels": png(b"", EMPTY_CHUNK * (MEGABYTES // 12)),
    "markers": jpeg(b"\xff\xfe\0\2" * (MEGABYTES // 4)),
    "fill bytes": jpeg(b"\xff" * MEGABYTES),
}


@pytest.mark.parametrize("what", LABORIOUS)
def test_an_image_that_takes_many_steps_to_read_is_refused(tmp_path: Path, what: str) -> None:
    """Each took a second or more, and some many, for each MB of the file."""
    path = write_map(tmp_path, LABORIOUS[what])
    with pytest.raises(BadInput, match=r"plan.pgm: has (more )?comments .*; save it as a PNG"):
        read_terrain(path, 0.1)


def test_a_header_may_have_comments(tmp_path: Path) -> None:
    header = b"# made by a mapper\n" * 500
    assert free_of(tmp_path, b"P2\n" + header + b"2 1\n255\n254 0\n") == [[True, False]]
    assert free_of(tmp_path, b"P5\n" + header + b"2 1\n255\n\xfe#") == [[True, False]]


def test_a_missing_image_or_file_is_named(tmp_path: Path) -> None:
    path = write_map(tmp_path, WHITE)
    (tmp_path / "plan.pgm").unlink()
    with pytest.raises(BadInput, match=r"plan\.pgm: no such file"):
        read_terrain(path, 0.1)
    (tmp_path / "plan.pgm").mkdir()
    with pytest.raises(BadInput, match="cannot be read"):
        read_terrain(path, 0.1)
    with pytest.raises(BadInput, match=r"none\.yaml"):
        read_terrain(tmp_path / "none.yaml", 0.1)


@pytest.mark.parametrize("text", ["", "- a\n- b\n", "image: [", "5"])
def test_a_yaml_that_is_no_map_is_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "plan.yaml"
    path.write_text(text)
    with pytest.raises(BadInput, match=r"plan\.yaml"):
        read_terrain(path, 0.1)


def test_a_scenarios_map_is_relative_to_its_base_and_keep_out_polygons_keep_bodies_out(tmp_path: Path) -> None:
    write_map(tmp_path, WHITE)
    assert load_terrain(TerrainSpec(map="plan.yaml"), 0.1, tmp_path).shape == (3, 4)
    assert load_terrain(TerrainSpec(builtin="open"), 0.5, tmp_path).shape == (176, 200)
    write_map(tmp_path, WHITE)
    zone = ((0.1, 0.0), (0.25, 0.0), (0.25, 0.1), (0.1, 0.1))
    terrain = load_terrain(TerrainSpec(map="plan.yaml", keep_out=(zone,)), 0.1, tmp_path)
    assert terrain.keep_out.tolist() == [[False, True, True, False], [False] * 4, [False] * 4]
    assert terrain.passable.all()
    everything = ((-1.0, -1.0), (9.0, -1.0), (9.0, 9.0), (-1.0, 9.0))
    with pytest.raises(BadInput, match="keep_out"):
        load_terrain(TerrainSpec(map="plan.yaml", keep_out=(everything,)), 0.1, tmp_path)
