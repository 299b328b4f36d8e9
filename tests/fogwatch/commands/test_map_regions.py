from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image
from typer.testing import CliRunner

from fogwatch.commands.map import app
from patrol.errors import BadInput


def output(*arguments: str) -> str:
    result = CliRunner().invoke(app, ["regions", *arguments], catch_exceptions=False)
    assert result.exit_code == 0
    return result.output


def test_tells_how_many_regions_there_are_and_into_which_the_body_fits() -> None:
    told = output("yards", "--point", "0.5")
    assert "yards: 100 x 88 m, points of 0.5 m; body radius 1 m" in told
    assert "regions: 5 convex regions found in " in told
    assert "\nconnections: 4\n" in told
    assert "m² around (50.00, 44.00), connected to 1, 3\n" in told
    assert "the body fits into 5\n" in told
    assert "\x1b" not in told
    told = output("yards", "--point", "0.5", "--radius", "17")
    assert "the body fits into 2\n" in told
    assert "connections: 0" in told


def test_polygons_can_be_taken_over_into_a_scenario(tmp_path: Path) -> None:
    output("clutter", "--point", "0.5", "--polygons", str(tmp_path / "regions.yaml"))
    section = yaml.safe_load((tmp_path / "regions.yaml").read_text())
    scenario = {"terrain": {"builtin": "clutter"}, "point": 0.5, "robots": {"radius": 0.7}, **section}
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(scenario))
    told = output(str(tmp_path / "mine.yaml"))
    assert f"regions: {len(section['patrol']['options']['regions'])} convex regions given in " in told
    assert "points of 0.5 m; body radius 0.7 m" in told


def test_the_picture_shows_regions_in_colours(tmp_path: Path) -> None:
    assert "picture: " in output("yards", "--point", "0.5", "--picture", str(tmp_path / "yards.png"))
    with Image.open(tmp_path / "yards.png") as image:
        pixels = np.asarray(image.convert("RGB")).reshape(-1, 3)
    assert len(pixels) > 500_000
    colours, counts = np.unique(pixels, axis=0, return_counts=True)
    large = colours[counts > 0.02 * len(pixels)]
    assert len([colour for colour in large.tolist() if len(set(colour)) == 3]) >= 5


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (("moon",), "moon: no such scenario or map file"),
        (("yards", "--point", "0"), "--point = 0: expected a finite number above 0"),
        (("yards", "--radius", "nan"), "--radius = nan: expected a finite number above 0"),
        (("yards", "--point", "1", "--picture", "no/such/folder.png"), "no/such/folder.png: cannot be written"),
        (("yards", "--point", "1", "--polygons", "no/such/folder.yaml"), "no/such/folder.yaml: cannot be written"),
    ],
)
def test_bad_input_is_one_line(arguments: tuple[str, ...], problem: str) -> None:
    with pytest.raises(BadInput) as caught:
        output(*arguments)
    assert str(caught.value).startswith(problem)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("more", "problem"),
    [
        (
            "patrol: {policy: potential-field, regions: [[[0, 0], [100, 0], [100, 80], [0, 80]]]}",
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
        output(str(site))
