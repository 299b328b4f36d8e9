import re
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from patrol.palette import DARK, LIGHT, ROBOTS, WALL, WALL_EDGE, css, rgb, script, with_walls

ROOT = Path(__file__).resolve().parents[2]


def luminance(colour: str) -> float:
    """Relative luminance as WCAG 2 defines it."""
    parts = np.array(rgb(colour)) / 255.0
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ (0.2126, 0.7152, 0.0722))


def contrast(one: str, other: str) -> float:
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def test_a_wall_or_its_edge_differs_from_every_age() -> None:
    page = (ROOT / "monitor" / "page" / "static" / "colours.js").read_text(encoding="utf-8")
    ages = [
        f"#{colour}" for colour in re.findall(r'"([0-9a-f]{6})"', page.partition("CIVIDIS = [")[2].partition("]")[0])
    ]
    assert len(ages) == 33
    assert all(max(contrast(WALL, age), contrast(WALL_EDGE, age)) >= 3.0 for age in ages)


def test_texts_can_be_read_in_both_themes() -> None:
    for theme in (LIGHT, DARK):
        for name in ("ink", "muted", "accent", "alert", "warn", "good"):
            assert contrast(theme[name], theme["card"]) >= 4.5, name


def test_robots_differ_also_for_who_cannot_tell_red_from_green() -> None:
    """After a simulation of deuteranopia (Vienot 1999), on linear red, green and blue."""
    blind = np.array([[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]])
    seen = [blind @ (np.array(rgb(colour)) / 255.0) ** 2.2 for colour in ROBOTS]
    assert min(float(np.linalg.norm(one - other)) for one, other in combinations(seen, 2)) > 0.05


def test_pages_get_these_colours() -> None:
    assert f'export const WALL = "{WALL}";' in script()
    assert all(colour in script() for colour in ROBOTS)
    light, dark = css().splitlines()
    assert f"--ink: {LIGHT['ink']};" in light
    assert dark.startswith("@media (prefers-color-scheme: dark)")
    assert f"--ink: {DARK['ink']};" in dark


@pytest.mark.parametrize("folder", ["monitor/page/static", "monitor/report", "fogwatch/pictures"])
def test_nobody_has_robots_or_walls_of_another_colour(folder: str) -> None:
    for file in sorted((ROOT / folder).glob("*.*")):
        if file.suffix in (".py", ".js", ".css"):
            text = file.read_text(encoding="utf-8")
            names = re.findall(r"^(?:export const )?(?:SERIES|PATHS|ROBOTS|WALL)\b.*=", text, re.MULTILINE)
            assert not names, file


def test_a_wall_is_drawn_with_an_edge_and_points_become_blocks() -> None:
    ground = np.full((3, 4, 3), 7, dtype=np.uint8)
    walls = np.zeros((3, 4), dtype=np.bool_)
    walls[1, 3] = True
    made = with_walls(ground, walls, 40, 2)
    assert made.shape == (30, 40, 3)
    assert tuple(made[15, 35]) == rgb(WALL)
    assert tuple(made[15, 28]) == tuple(made[9, 35]) == rgb(WALL_EDGE)
    assert tuple(made[15, 27]) == tuple(made[0, 0]) == (7, 7, 7)
    assert (ground == 7).all()
    clear = with_walls(np.zeros((3, 4, 4), dtype=np.uint8), walls, 4, 0)
    assert tuple(clear[1, 3]) == (*rgb(WALL), 255)
    assert clear[..., 3].sum() == 255
