"""Two replays side by side in a real browser: served, and as a folder of files without a server."""

import time
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest

from monitor.page.saved import save_page
from monitor.replay.player import Player
from tests.browser import PATIENCE_S, Look, browser_or_skip
from tests.monitor.conftest import Seen
from tests.monitor.pages import ServedPage

pytestmark = browser_or_skip()

LAST = 9
"""Last tick of the shorter run."""


@pytest.fixture(scope="module", params=["served", "saved"])
def address(
    request: pytest.FixtureRequest, faulty: Seen, edges: Seen, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[str]:
    """The address of the page of two runs, of 80 and of 10 ticks, to which a time is added."""
    runs = faulty.open(), edges.open()
    assert [run.ticks for run in runs] == [80, LAST + 1]
    if request.param == "saved":
        folder = tmp_path_factory.mktemp("saved") / "pair"
        assert save_page(runs, folder) == [80, LAST + 1]
        yield f"{(folder / 'index.html').as_uri()}?t="
    else:
        with closing(ServedPage(*(Player(run, autoplay=True) for run in runs))) as served:
            yield f"{served.address}&t="


def wait_for(frame: Any, script: str) -> None:
    """Wait until a script says yes in a frame."""
    end = time.monotonic() + PATIENCE_S
    while not frame.evaluate(script):
        assert time.monotonic() < end, f"never in {frame.url}: {script}"
        time.sleep(0.05)


def shown(look: Look, *ticks: int) -> list[Any]:
    """Wait until the frames show these ticks, and return the frames."""
    look.until("!document.getElementById('timeline').hidden")
    first, second = look.page.frames[1:]
    for frame, k in zip((first, second), ticks, strict=True):
        wait_for(frame, f"document.getElementById('clock').title === 'tick {k}'")
    return [first, second]


def test_both_follow_one_slider_and_the_keys_in_any_frame(chromium: Any, address: str) -> None:
    with Look(chromium, f"{address}3") as look:
        first, second = shown(look, 6, 6)
        assert look.evaluate("document.getElementById('play').textContent") == "play", "opened paused, at a time"
        for frame in (first, second):
            assert frame.evaluate("document.getElementById('transport').hidden")
            assert frame.evaluate("document.getElementById('timeline').hidden")
        look.slide(60)
        shown(look, 60, LAST)
        look.slide(4)
        shown(look, 4, 4)
        look.press(".")
        shown(look, 5, 5)
        second.locator("#canvas").focus()
        look.press(".")
        shown(look, 6, 6)
        look.slide(77)
        shown(look, 77, LAST)
        look.press(" ")
        look.until("document.getElementById('seek').value === '79'")
        shown(look, 79, LAST)
        look.until("document.getElementById('play').textContent === 'play'")


def test_viewers_without_rights_get_no_controls(chromium: Any, faulty: Seen, edges: Seen) -> None:
    players = [Player(run.open()) for run in (faulty, edges)]
    with closing(ServedPage(*players)) as served, Look(chromium, served.plain) as look:
        look.until("document.title.includes('replay')")
        assert look.evaluate("document.getElementById('transport').hidden")
        assert look.evaluate("document.getElementById('timeline').hidden")
        look.press(".")
        for frame in look.page.frames[1:]:
            wait_for(frame, "document.getElementById('clock').title === 'tick 0'")


def test_both_have_the_same_scales(chromium: Any, address: str) -> None:
    scales = (
        "document.getElementById('ticks').textContent",
        "JSON.stringify(document.getElementById('chart').layout.xaxis.range)",
        "JSON.stringify(document.getElementById('chart').layout.yaxis.range)",
    )
    with Look(chromium, f"{address}0") as look:
        frames = shown(look, 0, 0)
        for frame in frames:
            wait_for(frame, "document.getElementById('chart').layout?.xaxis.range[1] === 40")
        for scale in scales:
            first, second = (frame.evaluate(scale) for frame in frames)
            assert first == second


@pytest.mark.parametrize(("width", "scheme"), [(390, "dark"), (1280, "light")])
def test_it_fits_a_phone_and_a_laptop(chromium: Any, address: str, width: int, scheme: str) -> None:
    with Look(chromium, f"{address}2", width, 844, scheme) as look:
        shown(look, 4, 4)
        for frame in look.page.frames:
            assert frame.evaluate("document.documentElement.scrollWidth <= innerWidth")
            colour = frame.evaluate("getComputedStyle(document.documentElement).backgroundColor")
            dark = sum(map(int, colour.removeprefix("rgb(").removesuffix(")").split(","))) < 200
            assert dark == (scheme == "dark")
