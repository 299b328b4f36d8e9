"""The forces with sliders, on a page without the site around them: they draw what robots compute."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agent.policies.forces import distance_force, fow_force
from docs.site.forces import forces
from fogwatch.run_options import preset_settings
from patrol.scenario import PotentialFieldOptions, open_scenario
from tests.browser import Look, browser_or_skip

pytestmark = browser_or_skip()

WITHIN = 0.002
"""Half a tenth of a unit of the drawing, as a share of a curve's height, and a margin."""


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    page = tmp_path_factory.mktemp("forces") / "forces.html"
    html = forces().removeprefix("```{raw} html\n").removesuffix("```")
    page.write_text(f"<!doctype html><meta charset='utf-8'><title>forces</title>{html}", encoding="utf-8")
    return page


@pytest.fixture
def look(chromium: Any, page: Path) -> Iterator[Look]:
    with Look(chromium, page.as_uri()) as look:
        yield look


def give(look: Look, **values: object) -> None:
    for name, value in values.items():
        look.evaluate(
            f"""() => {{ const input = document.querySelector('[name={name}]'); input.value = '{value}';
                input.dispatchEvent(new Event('input', {{ bubbles: true }})); }}"""
        )


def curve(look: Look, number: int) -> Any:
    """Return the heights of a drawn curve, 0 to 1."""
    path = look.evaluate(
        f"document.querySelectorAll('#forces svg')[{number}].querySelector('.curve').getAttribute('d')"
    )
    heights = np.array([float(y) for y in re.findall(r",([\d.]+)", path)])
    axes = look.evaluate("document.querySelector('#forces .axes').getAttribute('d')")
    top, bottom = map(float, re.findall(r",([\d.]+)V([\d.]+)", axes)[0])
    return (bottom - heights) / (bottom - top)


def test_the_curves_are_those_of_the_code(look: Look) -> None:
    give(look, alpha=-2, beta=1, length=-1)
    for k in range(1, 6):
        give(look, fow=f"f{k}", distance=f"g{k}")
        by_age, by_length = curve(look, 0), curve(look, 1)
        force = fow_force(f"f{k}", np.linspace(0.0, 1.0, len(by_age)), 10.0)
        assert by_age == pytest.approx(force / force[-1], abs=WITHIN)
        force = distance_force(f"g{k}", np.maximum(np.linspace(0.0, 300.0, len(by_length)), 1.0), 8000.0, 400.0)
        assert by_length == pytest.approx(force / force[0], abs=WITHIN)


def test_the_command_sets_what_has_an_effect(look: Look) -> None:
    def command() -> str:
        text: str = look.evaluate("document.querySelector('#forces code').textContent")
        return text

    assert command() == "fogwatch run yards --preset paper"
    give(look, fow="f1", alpha=3, beta=3, length=3)
    more = "--set patrol.options.fow=f1 --set patrol.options.beta=32000"
    assert command() == f"fogwatch run yards --preset paper {more}"
    assert look.evaluate("document.querySelector('[name=alpha]').disabled")
    for end in (-3, 3):
        give(look, fow="f5", distance="g5", alpha=end, beta=end, length=end)
        overrides = {
            name: text if text.startswith(("f", "g")) else float(text)
            for name, text in (word.split("=") for word in command().split() if "=" in word)
        }
        assert len(overrides) == 5
        options = open_scenario("yards", {**preset_settings("paper"), **overrides}).patrol.options
        assert isinstance(options, PotentialFieldOptions)
        assert options.fow == "f5"
        assert options.alpha == 40.0 * 2.0**end


def test_more_ground_pulls_at_a_lower_level(look: Look) -> None:
    reach = look.evaluate(
        """[...document.querySelectorAll('#forces .area')].map((area) => area.getAttribute('d'))
            .map((path) => Math.max(...[...path.matchAll(/([\\d.]+),/g)].map((match) => Number(match[1]))))"""
    )
    assert len(reach) == 4
    assert sorted(set(reach), reverse=True) == reach
