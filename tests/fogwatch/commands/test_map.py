from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image
from typer.testing import CliRunner

from fogwatch.commands import map as map_commands
from fogwatch.commands.map import app
from fogwatch.pictures.maps import PERHAPS_UNKNOWN
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


def test_builtins_are_called_reconstructions() -> None:
    told = output("check", "yards", "--point", "0.5", "--through-walls", "--range", "12")
    assert "a reconstruction of the paper's" in told
    assert "sensor range 12 m, through walls" in told
    assert "sealed off: nothing" in told


def transform_in(told: str) -> tuple[float, ...]:
    return tuple(float(part) for part in told.splitlines()[-1].removeprefix("--transform=").split(","))


PLACES = "--landmark -2.8,6.8=1.2,5.8 --landmark 4.8,6.8=8.8,5.8"
"""Landmarks of `maps` that are right."""


def align(*arguments: str) -> str:
    return output("align", *arguments)


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
    told = align(*maps, *PLACES.split(), "--picture", str(tmp_path / "overlay.png"))
    assert "landmark 1, -2.8,6.8=1.2,5.8: off by 0.0" in told
    assert transform_in(told) == pytest.approx((4.0, -1.0, 0.0), abs=0.05)
    assert "walls that agree: 100%" in told
    assert f"picture: {tmp_path / 'overlay.png'}" in told
    with Image.open(tmp_path / "overlay.png") as picture:
        assert picture.format == "PNG"
        assert min(picture.size) > 300


def test_landmarks_where_few_walls_agree_are_warned_about(maps: tuple[str, str]) -> None:
    told = align(*maps, "--landmark", "0,2=0,0", "--landmark", "5,2=0,5")
    assert "few walls agree at these landmarks" in told
    assert "few walls agree at these landmarks" not in align(*maps, *PLACES.split())


def regions(*arguments: str) -> str:
    return output("regions", *arguments)


def test_tells_how_many_regions_there_are_and_into_which_the_body_fits() -> None:
    told = regions("yards", "--point", "0.5")
    assert "yards: 100 x 88 m, points of 0.5 m; body radius 1 m" in told
    assert "regions: 9 convex regions found in " in told
    assert "\nconnections: 8\n" in told
    assert "m² around (50.00, 44.00), connected to " in told
    assert "the body fits into 9\n" in told
    assert "\x1b" not in told
    told = regions("yards", "--point", "0.5", "--radius", "17")
    assert "the body fits into 2\n" in told
    assert "connections: 0" in told


def test_polygons_can_be_taken_over_into_a_scenario(tmp_path: Path) -> None:
    regions("clutter", "--point", "0.5", "--polygons", str(tmp_path / "regions.yaml"))
    section = yaml.safe_load((tmp_path / "regions.yaml").read_text())
    scenario = {"terrain": {"builtin": "clutter"}, "point": 0.5, "robots": {"radius": 0.7}, **section}
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(scenario))
    told = regions(str(tmp_path / "mine.yaml"))
    assert f"regions: {len(section['patrol']['options']['regions'])} convex regions given in " in told
    assert "points of 0.5 m; body radius 0.7 m" in told


def test_the_picture_shows_regions_in_colours(tmp_path: Path) -> None:
    assert "picture: " in regions("yards", "--point", "0.5", "--picture", str(tmp_path / "yards.png"))
    with Image.open(tmp_path / "yards.png") as image:
        pixels = np.asarray(image.convert("RGB")).reshape(-1, 3)
    assert len(pixels) > 500_000
    colours, counts = np.unique(pixels, axis=0, return_counts=True)
    large = colours[counts > 0.02 * len(pixels)]
    assert len([colour for colour in large.tolist() if len(set(colour)) == 3]) >= 5


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        ("check yrads", "did you mean yards"),
        ("check yards --radius 0", "--radius 0: expected 0.001 to 100000"),
        ("check yards --radius nan", "--radius nan: expected"),
        ("check yards --point -1", "--point -1: expected"),
        ("check yards --point 0.001", "more than"),
        ("check yards --range inf", "--range inf: expected"),
        ("check yards --radius 1e5 --point 0.5", "fits nowhere"),
        ("check yards --start 12", "--start 12: expected X,Y"),
        ("check yards --start a,b", "--start a,b: expected X,Y"),
        ("check yards --start 1,2,3,4", "--start 1,2,3,4: expected X,Y"),
        ("check yards --point 0.5 --start -900,5", "does not fit at"),
        ("check open --point 0.5 --picture /none/such/folder.png", "cannot be written"),
        ("check flat.png", "flat.png: is an image; give the map's YAML file"),
        (
            "align own.yaml ours.yaml --landmark 1,2",
            "--landmark 1,2: expected AX,AY=BX,BY in m, for example 0.4,1.2=12.5",
        ),
        ("align own.yaml ours.yaml --landmark 1,2=3,x", "--landmark 1,2=3,x: expected AX,AY=BX,BY in m"),
        ("align own.yaml ours.yaml --landmark 1,2=3,inf", "--landmark 1,2=3,inf: expected AX,AY=BX,BY in m"),
        ("align own.yaml ours.yaml --landmark 1,2=3,4", "--landmark: one says nothing of the turn; give two or more"),
        (
            "align own.yaml ours.yaml --landmark 0,2=1,1 --landmark 5,2=8,1",
            "off by 1.00 m, and --tolerance is 0.3 m; correct",
        ),
        (
            "align own.yaml ours.yaml --landmark 0,2=1,1 --landmark 1,2=2,1",
            "--landmark: all lie within 1.00 m on A; give",
        ),
        (
            "align own.yaml ours.yaml --landmark 1e308,2=1,1 --landmark 5,2=6,1",
            "--landmark: (1e+308, 2) is not on own, which",
        ),
        (f"align own.yaml ours.yaml {PLACES} --point 0", "--point 0: expected 0.001 to 100000"),
        (f"align own.yaml ours.yaml {PLACES} --tolerance 99", "--tolerance 99: expected 0.001 to 10"),
        (f"align own.yaml ours.yaml {PLACES} --picture /none/such/folder.png", "cannot be written"),
        (f"align nowhere.yaml yards {PLACES}", "nowhere.yaml: no such map file"),
        ("regions moon", "fogwatch: moon: no such scenario or map file"),
        ("regions yards --point 0", "fogwatch: --point 0: expected 0.001 to 100000"),
        ("regions yards --radius nan", "fogwatch: --radius nan: expected 0.001 to 100000"),
        ("regions yards --point 1 --picture no/such/folder.png", "fogwatch: no/such/folder.png: cannot be written"),
        ("regions yards --point 1 --polygons no/such/folder.yaml", "fogwatch: no/such/folder.yaml: cannot be written"),
    ],
)
@pytest.mark.usefixtures("flat", "maps")
def test_bad_input_is_one_line(words: str, problem: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BadInput) as caught:
        output(*words.split())
    told = f"fogwatch: {caught.value}"
    assert problem in told
    assert "\n" not in told


@pytest.mark.parametrize(
    ("more", "problem"),
    [
        (
            "patrol: {policy: potential-field, options: {regions: [[[0, 0], [100, 0], [100, 80], [0, 80]]]}}",
            r"patrol.options.regions: 800.00 m2 of free ground lie in no region",
        ),
        (
            "zones: [{name: vault, polygon: [[900, 1], [901, 1], [901, 2]], weight: 2}]",
            r"^SITE: zones\.0: vault lies outside of open",
        ),
    ],
    ids=["gap", "zone"],
)
def test_what_does_not_fit_the_ground_is_said_of_the_scenarios_file(more: str, problem: str, tmp_path: Path) -> None:
    site = tmp_path / "site.yaml"
    site.write_text(f"terrain: {{builtin: open}}\npoint: 0.5\n{more}\n")
    with pytest.raises(BadInput, match=problem.replace("SITE", str(site))):
        regions(str(site))


@pytest.mark.parametrize("words", [["check", "open"], ["regions", "open"], ["align", "open", "open", *PLACES.split()]])
def test_a_pictures_file_is_refused_before_the_work(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(map_commands, "warm", lambda *_: pytest.fail("the work has begun"))
    monkeypatch.setattr(map_commands, "named_terrain", lambda *_: pytest.fail("the work has begun"))
    for name, says in (
        ("x.xyz", "expected a name that ends in .png"),
        ("nowhere/x.png", "no such folder"),
        ("", "is a folder"),
    ):
        with pytest.raises(BadInput, match=says):
            CliRunner().invoke(app, [*words, "--picture", str(tmp_path / name)], catch_exceptions=False)


def test_a_maps_own_image_is_not_drawn_over(flat: Path, maps: tuple[str, str]) -> None:
    room = flat.with_name("room.png")
    for words, image in ((["check", str(flat)], flat.with_suffix(".png")), (["align", *maps, *PLACES.split()], room)):
        content = image.read_bytes()
        with pytest.raises(BadInput, match=r"is a file of the map (flat|own); give another name"):
            output(*words, "--picture", str(image))
        assert image.read_bytes() == content
