"""The page of a run that is over, in a real browser."""

import threading
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest

from monitor.replay.past_beliefs import PastBeliefs
from monitor.replay.player import Player
from monitor.replay.run_log import RunLog
from tests.browser import Look, browser_or_skip
from tests.monitor.conftest import Seen
from tests.monitor.live.test_feed_source import FakeFeed
from tests.monitor.pages import ServedPage, look_at, pixels

pytestmark = browser_or_skip()

YELLOW = pixels("d[i] > 240 && d[i + 1] > 220 && d[i + 2] < 80")
"""Counts the pixels of the map that have the colour of ground that has just been seen."""


@pytest.fixture(scope="module")
def page(faulty: Seen) -> Iterator[ServedPage]:
    served = ServedPage(Player(faulty.open()))
    yield served
    served.close()


def colours(look: Look) -> int:
    """Count the colours of the map's middle, roughly."""
    script = """() => { const c = document.getElementById('canvas'), d = c.getContext('2d')
        .getImageData(c.width / 4, c.height / 4, c.width / 2, c.height / 2).data, seen = new Set();
        for (let i = 0; i < d.length; i += 44) seen.add([d[i] >> 4, d[i + 1] >> 4, d[i + 2] >> 4].join());
        return seen.size; }"""
    return int(look.evaluate(script))


def test_the_map_paints_and_the_robots_move(chromium: Any, page: ServedPage) -> None:
    with Look(chromium, page.address) as look:
        look.until("document.body.dataset.frames > 0")
        assert look.evaluate("location.search") == ""
        look.press("]")
        look.press(" ")
        look.until("Number(document.getElementById('seek').value) > 30")
        look.press(" ")
        look.until("document.getElementById('play').textContent === 'play'")
        assert colours(look) > 12
        before = look.picture("#canvas")
        tick = look.evaluate("document.getElementById('clock').title")
        look.press(".")
        look.press(".")
        look.until(f"document.getElementById('clock').title !== {tick!r}")
        look.until("document.querySelectorAll('#rows tr').length === 3")
        assert look.picture("#canvas") != before
        look.until("document.querySelectorAll('#chart .scatterlayer .trace').length === 2")
        assert look.evaluate("document.querySelectorAll('#chart .shapelayer path').length") > 3


def test_any_time_any_fog_and_what_a_point_is(chromium: Any, page: ServedPage) -> None:
    with Look(chromium, page.address) as look:
        look.until("document.body.dataset.frames > 0")
        look.seek(50)
        look.until("document.getElementById('rows').textContent.includes('dead')")
        for fog, says in (("0", "ago"), ("3", "ago"), ("d3", "believed")):
            look.page.select_option("#layer", fog)
            look.page.hover("#canvas", position={"x": 455, "y": 300})
            look.until(f"document.getElementById('tip').textContent.includes({says!r})")
        look.evaluate("document.getElementById('canvas').focus()")
        before = look.picture("#canvas")
        for key in ("+", "+", "ArrowLeft", "l", "n"):
            look.press(key)
        look.until("document.querySelector('#rows button[aria-pressed=true]') !== null")
        assert look.picture("#canvas") != before
        look.press("c")
        look.press("Shift+ArrowLeft")
        look.until("/seen|obstacle|patrolled/.test(document.getElementById('tip').textContent)")
        for pane in ("links", "events", "robots"):
            look.page.click(f"#tab-{pane}")
            assert look.evaluate(f"!document.getElementById('{pane}').hidden")
            if pane == "links":
                look.until("!document.getElementById('matrix').hidden")
                look.page.focus("#matrix")
                look.press("ArrowDown")
                look.press("ArrowDown")
                look.until("document.getElementById('linktip').textContent.startsWith('r3 to r2: ')")


def test_the_scale_does_not_depend_on_the_way_to_a_time(chromium: Any, page: ServedPage) -> None:
    def legend(look: Look, fog: str) -> str:
        look.page.select_option("#layer", fog)
        return str(look.evaluate("document.getElementById('ticks').textContent"))

    shown = []
    for way in ([70, 3, 12, 0, 20], [20], [0, 5, 10, 15, 20]):
        with Look(chromium, page.address) as look:
            look.until("document.querySelectorAll('#chart .scatterlayer .trace').length === 2")
            for k in way:
                look.seek(k)
            shown.append([legend(look, fog) for fog in ("d3", "3", "0")])
    assert shown[0] == shown[1] == shown[2]
    assert [text.partition("≥")[2] for text in shown[0]] == [" 10 s", " 40 s", " 40 s"]


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize(("width", "height"), [(1280, 720), (390, 800)])
def test_it_fits_in_light_and_in_dark(chromium: Any, page: ServedPage, scheme: str, width: int, height: int) -> None:
    with Look(chromium, page.address, width, height, scheme) as look:
        look.until("document.querySelectorAll('#chart .scatterlayer .trace').length === 2")
        assert look.evaluate("document.documentElement.scrollWidth") <= width
        assert look.evaluate("document.getElementById('seek').offsetHeight") >= 24
        if width > 1000:
            assert look.evaluate("document.documentElement.scrollHeight") <= height
        style = "getComputedStyle(document.documentElement)"
        tones = (look.evaluate(f"{style}.{one}") for one in ("color", "backgroundColor"))
        ink, paper = (sum(map(int, tone[4:-1].split(","))) for tone in tones)
        assert (ink > paper) == (scheme == "dark")
        small = """[...document.querySelectorAll('button, select')].filter((one) => one.offsetParent)
            .filter((one) => one.offsetHeight < 22).map((one) => one.id || one.textContent)"""
        assert look.evaluate(small) == []


def test_links_that_are_read_slowly_come_by_themselves(
    chromium: Any, faulty: Seen, monkeypatch: pytest.MonkeyPatch
) -> None:
    may_read, read = threading.Event(), RunLog.read
    monkeypatch.setattr(RunLog, "read", lambda log: read(log) if may_read.is_set() else None)
    with look_at(chromium, Player(faulty.open())) as look:
        look.page.click("#tab-links")
        look.seek(70)
        look.until("document.getElementById('linktip').textContent === 'computing …'")
        assert look.evaluate("document.getElementById('matrix').hidden")
        may_read.set()
        look.until("!document.getElementById('matrix').hidden")
        assert look.evaluate("document.getElementById('linktip').textContent") == "rows: senders, columns: receivers"


def test_a_belief_is_not_shown_until_it_is_known(chromium: Any, faulty: Seen, monkeypatch: pytest.MonkeyPatch) -> None:
    known, last_seen = threading.Event(), PastBeliefs.last_seen
    monkeypatch.setattr(PastBeliefs, "last_seen", lambda *of: last_seen(*of) if known.is_set() else None)
    caption, tip = (f"document.getElementById('{name}').textContent" for name in ("legendtext", "tip"))
    with look_at(chromium, Player(faulty.open())) as look:
        look.page.hover("#canvas", position={"x": 455, "y": 300})
        truth = look.picture("#canvas")
        for fog in ("3", "d3"):
            known.clear()
            look.page.select_option("#layer", fog)
            look.seek(50 if fog == "3" else 20)
            look.until(f"{caption} === 'computing …' && {tip}.includes('computing …')")
            assert look.evaluate(YELLOW) == 0
            known.set()
            look.until(f"{caption} !== 'computing …' && !{tip}.includes('computing')")
            look.until(f"/seen .* ago/.test({tip})")
            assert (look.evaluate(YELLOW) > 1000) == (fog == "3")
        assert look.picture("#canvas") != truth


def test_a_run_that_is_over_stays_over_when_its_page_ends(chromium: Any, faulty: Seen) -> None:
    wire = FakeFeed(faulty)
    with closing(ServedPage(wire.source())) as served, Look(chromium, served.address) as look:
        wire.send(10_000)
        look.until("document.getElementById('mode').textContent === 'over: completed'")
        look.until("document.querySelectorAll('#chart .scatterlayer .trace').length === 2")  # nothing is on its way
        served.close()
        look.until("document.getElementById('note').textContent.includes('fogwatch replay')")
        assert look.evaluate("document.getElementById('mode').textContent") == "over: completed"


def test_who_lacks_the_key_is_told_so(chromium: Any, page: ServedPage) -> None:
    with Look(chromium, page.plain) as look:
        look.until("document.body.dataset.frames > 0")
        assert look.evaluate("document.getElementById('transport').hidden")
        assert look.evaluate("document.getElementById('timeline').hidden")
