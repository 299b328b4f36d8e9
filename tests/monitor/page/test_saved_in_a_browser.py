"""The page of a run as a folder of files, in a real browser that finds no server."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monitor.page import saved
from monitor.page.saved import save_page
from patrol.ground.fog import NEVER
from tests.browser import Look, browser_or_skip
from tests.monitor.conftest import Seen

pytestmark = browser_or_skip()


@pytest.fixture(scope="module")
def page(faulty: Seen, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A saved page of a run with faults, with whole fogs far apart from each other."""
    folder = tmp_path_factory.mktemp("saved") / "page"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(saved, "KEY", 16)
        assert save_page([faulty.open()], folder) == [faulty.open().ticks]
    return folder


def test_any_time_shows_the_true_fog_and_the_measures_of_the_run(chromium: Any, page: Path, faulty: Seen) -> None:
    run = faulty.open()
    compared = 0
    with Look(chromium, f"{(page / 'index.html').as_uri()}?t=3") as look:
        look.until("document.getElementById('clock').title === 'tick 6'")
        assert look.evaluate("document.getElementById('play').textContent") == "play", "opened paused, at a time"
        look.page.hover("#canvas", position={"x": 455, "y": 300})
        # Forwards within a stretch, over several whole fogs, and backwards.
        for k in (9, 15, 16, 50, 79, 33, 32, 0, 20):
            look.seek(k)
            assert look.evaluate("document.getElementById('mfow').textContent") == seconds(run.mfow[k] * run.step)
            look.until(f"document.querySelectorAll('#rows tr').length === {len(run.names)}")
            tip = look.evaluate("document.getElementById('tip').textContent")
            said = re.match(r"([-\d.]+), ([-\d.]+) m\n(.*)", tip)
            assert said is not None
            col, row = (int(float(value) // run.prepared.terrain.point) for value in said.groups()[:2])
            truth = faulty.truth[k][row, col]
            age = seconds((k - max(truth, 0)) * run.step)
            assert said[3] == (f"never seen ({age})" if truth == NEVER else f"seen {age} ago")
            compared += truth != NEVER
        assert compared >= 2
        look.seek(79)
        look.until("document.querySelectorAll('#chart .scatterlayer .trace').length === 2")
        look.page.click("#tab-events")
        look.until("document.getElementById('events').textContent.includes('r1')")
        look.page.click("#tab-links")
        look.until("!document.getElementById('matrix').hidden")


def test_it_plays_by_itself_pauses_steps_and_plays_backwards(chromium: Any, page: Path) -> None:
    with Look(chromium, (page / "index.html").as_uri()) as look:
        look.until("Number(document.getElementById('seek').value) > 2")
        assert look.evaluate("document.getElementById('play').textContent") == "pause"
        look.press(" ")
        look.until("document.getElementById('play').textContent === 'play'")
        look.seek(40)
        look.press(".")
        look.until("document.getElementById('clock').title === 'tick 41'")
        look.press(",")
        look.press(".")
        look.until("document.getElementById('clock').title === 'tick 40'")
        look.press(" ")
        look.until("Number(document.getElementById('seek').value) < 38")
        look.press("/")
        look.seek(78)
        look.until("document.getElementById('play').textContent === 'play'")
        assert look.evaluate("document.getElementById('clock').title") == "tick 79", "it ends at the end"


def test_of_a_long_run_some_ticks_are_kept(
    chromium: Any, faulty: Seen, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(saved, "MOST_FRAMES", 30)
    run = faulty.open()
    assert run.ticks == 80
    assert save_page([run], tmp_path) == [len(np.unique([*range(0, 80, 3), 79]))]
    with Look(chromium, f"{(tmp_path / 'index.html').as_uri()}?t=0") as look:
        look.until("document.body.dataset.frames > 0")
        look.seek(79)
        look.slide(31)
        look.until("document.getElementById('clock').title === 'tick 30'")


def seconds(value: float) -> str:
    """As the page writes it."""
    return f"{value:.1f} s" if value < 10 else f"{int(value + 0.5)} s"
