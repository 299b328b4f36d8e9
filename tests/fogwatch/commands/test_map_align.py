from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from fogwatch.commands.map import app
from patrol.errors import BadInput


def output(*arguments: str) -> str:
    result = CliRunner().invoke(app, ["align", *arguments], catch_exceptions=False)
    assert result.exit_code == 0
    return result.output


def transform_in(told: str) -> tuple[float, ...]:
    return tuple(float(part) for part in told.splitlines()[-1].removeprefix("--transform=").split(","))


@pytest.fixture
def maps(tmp_path: Path) -> tuple[str, str]:
    """A robot's map and ours, of an L-shaped room; the robot's lies at (4, -1) on ours."""
    cells = np.full((80, 100), 205, dtype=np.uint8)
    cells[10:70, 10:90] = 0
    cells[12:68, 12:40] = 254
    cells[50:68, 12:88] = 254
    cells[30:36, 20:28] = cells[14:24, 30:36] = cells[40:46, 14:17] = cells[54:58, 70:72] = 0
    Image.fromarray(cells).save(tmp_path / "room.png")
    for name, origin in (("own", [-4, 1, 0]), ("ours", [0, 0, 0])):
        (tmp_path / f"{name}.yaml").write_text(
            f"image: room.png\nresolution: 0.1\norigin: {origin}\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2"
        )
    return str(tmp_path / "own.yaml"), str(tmp_path / "ours.yaml")


def test_the_last_line_is_the_option_of_the_agent(maps: tuple[str, str], tmp_path: Path) -> None:
    told = output(*maps, "--picture", str(tmp_path / "overlay.png"))
    assert transform_in(told) == pytest.approx((4.0, -1.0, 0.0), abs=0.05)
    assert "walls that agree: 100%; at the next best place" in told
    assert f"picture: {tmp_path / 'overlay.png'}" in told
    with Image.open(tmp_path / "overlay.png") as picture:
        assert picture.format == "PNG"
        assert min(picture.size) > 300


def test_landmarks_that_agree_are_taken(maps: tuple[str, str]) -> None:
    told = output(*maps, "--landmark", "-2.8,6.8=1.2,5.8", "--landmark", "4.8,6.8=8.8,5.8", "--landmark", "0,2=4,1.1")
    assert "landmark 1, -2.8,6.8=1.2,5.8: off by 0.0" in told
    assert "walls that agree: " in told
    assert transform_in(told) == pytest.approx((4.0, -1.0, 0.0), abs=0.1)


def test_landmarks_where_few_walls_agree_are_warned_about(maps: tuple[str, str]) -> None:
    told = output(*maps, "--landmark", "0,2=0,0", "--landmark", "5,2=0,5")
    assert "few walls agree at these landmarks" in told


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--landmark", "1,2"], "--landmark 1,2: expected AX,AY=BX,BY in m, for example 0.4,1.2=12.5,3"),
        (["--landmark", "1,2=3,x"], "--landmark 1,2=3,x: expected AX,AY=BX,BY in m"),
        (["--landmark", "1,2=3,inf"], "--landmark 1,2=3,inf: expected AX,AY=BX,BY in m"),
        (["--landmark", "1,2=3,4"], "--landmark: one says nothing of the turn; give two or more"),
        (["--landmark", "0,2=1,1", "--landmark", "5,2=8,1"], "off by 1.00 m, and --tolerance is 0.3 m; correct the"),
        (["--landmark", "0,2=1,1", "--landmark", "1,2=2,1"], "--landmark: all lie within 1.00 m on A; give some at"),
        (["--landmark", "1e308,2=1,1", "--landmark", "5,2=6,1"], "--landmark: (1e+308, 2) is not on own, which spans"),
        (["--point", "0"], "--point = 0: expected a finite number above 0, in m"),
        (["--tolerance", "99"], "--tolerance = 99: allows anything; give at most 10, in m"),
        (["--picture", "/none/such/folder.png"], "cannot be written"),
    ],
)
def test_bad_input_is_one_line(more: list[str], words: str, maps: tuple[str, str]) -> None:
    with pytest.raises(BadInput) as caught:
        output(*maps, *more)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_symmetric_terrain_is_refused_and_still_drawn(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="the maps lie on each other in 2 ways or more"):
        output("yards", "yards", "--point", "0.5", "--picture", str(tmp_path / "overlay.png"))
    assert (tmp_path / "overlay.png").exists()


def test_a_map_that_is_not_there_is_refused() -> None:
    with pytest.raises(BadInput, match=r"nowhere\.yaml: no such map file"):
        output("nowhere.yaml", "yards")


def test_a_picture_is_not_drawn_over_a_map(maps: tuple[str, str], tmp_path: Path) -> None:
    before = (tmp_path / "room.png").read_bytes()
    with pytest.raises(BadInput, match=r"room\.png: is a file of the map own"):
        output(*maps, "--picture", str(tmp_path / "room.png"))
    assert (tmp_path / "room.png").read_bytes() == before
