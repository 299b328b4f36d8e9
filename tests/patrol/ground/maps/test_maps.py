from __future__ import annotations

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
from PIL import Image

from patrol.errors import BadInput
from patrol.ground.maps.cells import free_cells
from patrol.ground.maps.load import load_terrain, read_terrain, resample, suspicious_reading
from patrol.ground.maps.map_file import read_map_file
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


# --- what a pixel means ----------------------------------------------------------------------------------------------


def test_trinary_calls_free_what_is_below_free_thresh(tmp_path: Path) -> None:
    # Occupancies 0.996, 0.35, 0.196 (205: the usual grey for unknown), 0.192, 0.004.
    assert free_of(tmp_path, grey([1, 166, 205, 206, 254])) == [[False, False, False, True, True]]


def test_negate_turns_black_free(tmp_path: Path) -> None:
    assert free_of(tmp_path, grey([0, 49, 50, 255]), negate=1) == [[True, True, False, False]]
    assert free_of(tmp_path, grey([0, 255]), negate=True) == [[True, False]]
    assert free_of(tmp_path, grey([0, 255]), negate=False) == [[False, True]]


def test_the_images_lower_row_has_the_lowest_y(tmp_path: Path) -> None:
    terrain = read_terrain(write_map(tmp_path, grey([0, 0, 0], [0, 254, 254]), {"origin": [-3.0, 2.0, 0.0]}), 0.1)
    assert terrain.passable.tolist() == [[False, True, True], [False, False, False]]
    assert terrain.bounds == pytest.approx((-3.0, 2.0, -2.7, 2.2))
    assert terrain.name == "plan"


def test_trinary_averages_colours_with_opacity(tmp_path: Path) -> None:
    pixels = np.array([[[255, 255, 255, 255], [255, 255, 255, 0], [0, 0, 0, 0], [255, 255, 110, 255]]], dtype=np.uint8)
    image = Image.fromarray(pixels)
    # Shades 1, 0.75, 0, 0.858: a transparent white is unknown.
    assert free_of(tmp_path, image, image="plan.png") == [[True, False, False, True]]
    without = Image.fromarray(np.ascontiguousarray(pixels[..., :3]))
    assert free_of(tmp_path, without, image="plan.png") == [[True, True, False, True]]


def test_scale_leaves_what_is_not_opaque_unknown(tmp_path: Path) -> None:
    pixels = np.array([[[255, 255, 255, 255], [255, 255, 255, 254], [205, 205, 205, 255]]], dtype=np.uint8)
    assert free_of(tmp_path, Image.fromarray(pixels), image="plan.png", mode="scale") == [[True, False, False]]


def test_raw_is_occupancy_in_percent_whatever_negate_says(tmp_path: Path) -> None:
    image = grey([0, 19, 20, 100, 101, 255])
    expected = [[True, True, False, False, False, False]]
    assert free_of(tmp_path, image, mode="raw") == expected
    assert free_of(tmp_path, image, mode="raw", negate=1) == expected


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


def test_a_16_bit_png(tmp_path: Path) -> None:
    image = Image.fromarray(np.array([[65535, 52800, 52300, 0]], dtype=np.uint16))
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


# --- resampling ------------------------------------------------------------------------------------------------------


@settings(max_examples=150)
@given(
    cells=hnp.arrays(np.bool_, st.tuples(st.integers(1, 12), st.integers(1, 12))),
    resolution=st.sampled_from([0.05, 0.075, 0.1, 0.15, 0.25, 1.0 / 3.0, 0.4]),
    point=st.sampled_from([0.05, 0.1, 0.13, 0.2, 0.3, 0.7]),
)
def test_a_point_is_free_where_all_cells_under_it_are(cells: np.ndarray, resolution: float, point: float) -> None:
    passable = resample(cells, resolution, point)
    assert passable.shape == tuple(math.floor(count * resolution / point + 1e-6) for count in cells.shape)

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
        assert np.array_equal(resample(cells, size, size), cells)


# --- bad input -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("says", "problem"),
    [
        ({"image": None}, "image: missing"),
        ({"image": ""}, "image ="),
        ({"image": 5}, "image = 5"),
        ({"resolution": None}, "resolution: missing"),
        ({"resolution": 0}, "resolution = 0"),
        ({"resolution": -0.1}, "resolution = -0.1"),
        ({"resolution": math.nan}, "resolution = NaN"),
        ({"resolution": math.inf}, "resolution = Infinity"),
        ({"resolution": "wide"}, 'resolution = "wide"'),
        ({"resolution": True}, "resolution = true"),
        ({"resolution": [0.1]}, "resolution = [0.1]"),
        ({"resolution": 1e9}, "more than"),
        ({"resolution": 1e308}, "more than"),
        ({"resolution": 1e-9}, "less than one point"),
        ({"origin": None}, "origin: missing"),
        ({"origin": [0.0, 0.0]}, "origin ="),
        ({"origin": "here"}, "origin ="),
        ({"origin": [0.0, math.nan, 0.0]}, "origin = NaN"),
        ({"origin": [0.0, 0.0, 0.5]}, "yaw must be 0"),
        ({"negate": None}, "negate: missing"),
        ({"negate": 2}, "negate = 2"),
        ({"negate": "maybe"}, 'negate = "maybe"'),
        ({"occupied_thresh": None}, "occupied_thresh: missing"),
        ({"free_thresh": None}, "free_thresh: missing"),
        ({"free_thresh": math.nan}, "free_thresh = NaN"),
        ({"free_thresh": 0.7}, "free_thresh = 0.7"),
        ({"free_thresh": -0.1}, "free_thresh = -0.1"),
        ({"occupied_thresh": 1.5}, "occupied_thresh = 1.5"),
        ({"mode": "trinity"}, "did you mean trinary"),
        ({"mode": 3}, "mode = 3"),
        ({"negate": 1}, "leaves no free cell"),
        ({"free_thresh": 0.0}, "leaves no free cell"),
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


WALLED = np.pad(np.full((38, 38), 254, dtype=np.uint8), 1)
"""A room of 38 x 38 free cells with walls of one cell."""


@pytest.mark.parametrize(
    ("says", "words"),
    [
        ({"negate": 1}, "negate = true, mode = trinary, free_thresh = 0.196 and occupied_thresh = 0.65 make 9.8 % of"),
        ({"negate": 1}, "90.2 % occupied and 0.0 % unknown; if the image shows something else, correct negate, mode"),
        ({"negate": 1}, "or the thresholds (negate: 0 would make 90.2 % free)"),
        ({"mode": "raw"}, "9.8 % of its cells free, 0.0 % occupied and 90.2 % unknown"),
        ({"mode": "raw"}, "(mode: trinary would make 90.2 % free)"),
    ],
    ids=str,
)
def test_settings_that_leave_only_the_walls_free_are_suspicious(
    tmp_path: Path, says: dict[str, Any], words: str
) -> None:
    terrain = read_terrain(write_map(tmp_path, Image.fromarray(WALLED), says), 0.1)
    assert words in suspicious_reading(terrain)
    assert suspicious_reading(read_terrain(write_map(tmp_path, Image.fromarray(WALLED)), 0.1)) == ""


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
        (b"P5\n12000 12000\n255\n", "pixels"),
        (b"", "is not a PGM"),
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


def test_free_space_too_narrow_for_the_points_is_told(tmp_path: Path) -> None:
    path = write_map(tmp_path, grey([0, 254, 0, 254], [0, 254, 0, 254]))
    assert read_terrain(path, 0.1).passable.any()
    with pytest.raises(BadInput, match="choose a smaller point"):
        read_terrain(path, 0.2)


# --- what a scenario asks for ----------------------------------------------------------------------------------------


def test_a_scenarios_map_is_relative_to_its_base(tmp_path: Path) -> None:
    write_map(tmp_path, WHITE)
    assert load_terrain(TerrainSpec(map="plan.yaml"), 0.1, tmp_path).shape == (3, 4)
    assert load_terrain(TerrainSpec(builtin="open"), 0.5, tmp_path).shape == (176, 200)


def test_keep_out_polygons_keep_bodies_out(tmp_path: Path) -> None:
    write_map(tmp_path, WHITE)
    zone = ((0.1, 0.0), (0.25, 0.0), (0.25, 0.1), (0.1, 0.1))
    terrain = load_terrain(TerrainSpec(map="plan.yaml", keep_out=(zone,)), 0.1, tmp_path)
    assert terrain.keep_out.tolist() == [[False, True, True, False], [False] * 4, [False] * 4]
    assert terrain.passable.all()
    everything = ((-1.0, -1.0), (9.0, -1.0), (9.0, 9.0), (-1.0, 9.0))
    with pytest.raises(BadInput, match="keep_out"):
        load_terrain(TerrainSpec(map="plan.yaml", keep_out=(everything,)), 0.1, tmp_path)
