from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from rich.console import Console
from typer.testing import CliRunner

from fogwatch.commands import map as map_commands
from fogwatch.commands.map import app
from fogwatch.pictures.run_end import PERHAPS_UNKNOWN
from patrol.errors import BadInput
from patrol.palette import rgb
from tests.fogwatch.conftest import Shell


def output(*arguments: str) -> str:
    result = CliRunner().invoke(app, arguments, catch_exceptions=False)
    assert result.exit_code == 0
    return result.output


@pytest.fixture
def flat(tmp_path: Path) -> Path:
    """A flat of three rooms in a field: a door of 0.9 m, one of 0.5 m; and a closet without a door."""
    cells = np.zeros((60, 120), dtype=np.uint8)
    cells[:, :2] = cells[:, -2:] = cells[:2] = cells[-2:] = 254
    cells[6:40, 6:38] = 254
    cells[6:40, 40:74] = 254
    cells[6:40, 76:112] = 254
    cells[42:56, 6:60] = 254
    cells[20:29, 38:40] = 254
    cells[20:25, 74:76] = 254
    Image.fromarray(cells).save(tmp_path / "flat.png")
    (tmp_path / "flat.yaml").write_text(
        "image: flat.png\nresolution: 0.1\norigin: [-2, 5, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2"
    )
    return tmp_path / "flat.yaml"


def test_says_what_is_reached_and_what_is_not_and_why(flat: Path) -> None:
    told = output("check", str(flat), "--radius", "0.35")
    assert "flat: 12 x 6 m, 120 x 60 points of 0.1 m" in told
    for label in ("free", "reachable", "patrolled", "never seen"):
        assert f"\n  {label}" in told
    assert "sealed off: 3 parts\n" in told
    assert "is too narrow, 0.50 m, and lets a radius of 0.20 m pass" in told
    assert "walled off, without an opening" in told
    assert "  0.90 m at (1.95, 8.55): lets a radius of 0.40 m pass, a wider body loses" in told
    assert "\x1b" not in told
    with Image.open(flat.with_suffix(".png")) as image:
        cells = np.asarray(image).copy()
    cells[45:49, 100:104] = 254
    Image.fromarray(cells).save(flat.with_suffix(".png"))
    told = output("check", str(flat), "--radius", "0.35")
    assert "sealed off: 3 parts, and 1 small part of 0.2 m² in total\n" in told


def test_a_start_decides_which_part_is_patrolled(flat: Path) -> None:
    left = output("check", str(flat), "--radius", "0.35", "--start", "0,6.5")
    right = output("check", str(flat), "--radius", "0.35", "--start", "7,7.5")
    assert left != right
    both = output("check", str(flat), "--radius", "0.35", "--start", "0,6.5", "--start", "7,7.5")
    assert both not in (left, right)


def test_unknown_ground_that_is_read_as_free_is_named_and_drawn(flat: Path, shell: Shell) -> None:
    with Image.open(flat.with_suffix(".png")) as image:
        cells = np.asarray(image).copy()
    cells[42:56, 6:60] = 205
    Image.fromarray(cells).save(flat.with_suffix(".png"))
    picture = flat.with_name("flat-check.png")
    shown = shell("map", "check", flat, "--radius", "0.35", "--picture", picture)
    assert shown.code == 0
    assert f"picture: {picture}" in shown.out
    assert "warning: flat.yaml: free_thresh = 0.2 reads grey 205 as free: 7.6 m² of" in shown.err
    with Image.open(picture) as drawn:
        assert drawn.format == "PNG"
        assert min(drawn.size) > 300
        colours = {colour for _, colour in drawn.convert("RGB").getcolors(1 << 24) or []}
    assert rgb(PERHAPS_UNKNOWN) in colours


def test_a_terminal_gets_tables(flat: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(map_commands, "Console", lambda: Console(force_terminal=True, width=160, file=sys.stdout))
    told = output("check", str(flat), "--radius", "0.35")
    assert "\x1b[" in told
    assert "m² behind" in told
    assert "0.90" in told


def test_builtins_are_called_reconstructions() -> None:
    told = output("check", "yards", "--point", "0.5", "--through-walls", "--range", "12")
    assert "a reconstruction of the paper's" in told
    assert "sensor range 12 m, through walls" in told
    assert "sealed off: nothing" in told


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ("yrads", "did you mean yards"),
        ("yards --radius 0", "--radius = 0"),
        ("yards --radius nan", "--radius = nan"),
        ("yards --point -1", "--point = -1"),
        ("yards --point 1e-9", "more than"),
        ("yards --range inf", "--range = inf"),
        ("yards --radius 1e300 --point 0.5", "fits nowhere"),
        ("yards --start 12", "--start = 12"),
        ("yards --start a,b", "--start = a,b"),
        ("yards --start 1,2,3,4", "--start = 1,2,3,4"),
        ("yards --point 0.5 --start -900,5", "does not fit at"),
        ("open --point 0.5 --picture /none/such/folder.png", "cannot be written"),
        ("flat.png", "flat.png: is an image; give the map's YAML file"),
    ],
)
def test_bad_input_is_one_line(arguments: str, problem: str, flat: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(flat.parent)
    with pytest.raises(BadInput) as caught:
        output("check", *arguments.split())
    assert problem in str(caught.value)
    assert "\n" not in str(caught.value)
