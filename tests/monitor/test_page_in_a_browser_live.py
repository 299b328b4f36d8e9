"""The page of a fleet that is running, in a real browser; its world is played here."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from contextlib import closing
from typing import TYPE_CHECKING, Any

import pytest

from monitor.source import Answer
from tests.browser import PATIENCE_S, Look, browser_or_skip, looking
from tests.monitor.pages import ServedPage
from tests.monitor.test_feed import Told

if TYPE_CHECKING:
    from tests.monitor.conftest import Seen

pytestmark = browser_or_skip()

MIDDLE = {"x": 455, "y": 300}


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with looking() as running:
        yield running


def text_of(look: Look, name: str) -> str:
    return str(look.evaluate(f"document.getElementById({name!r}).textContent"))


def test_who_comes_late_sees_what_is_not_known_as_that(chromium: Any, quiet: Seen) -> None:
    wire = Told(quiet)
    wire.number = 61
    with closing(ServedPage(wire.source())) as served, Look(chromium, served.address) as look:
        look.until("document.body.dataset.frames > 0")
        assert "known" not in text_of(look, "legendtext")
        for fog in ("-1", "2", "d2"):
            look.page.select_option("#layer", fog)
            look.page.hover("#canvas", position=MIDDLE)
            look.until("document.getElementById('legendtext').textContent.endsWith('striped: not known')")
            look.until("document.getElementById('tip').textContent.includes('s at least; known from 30 s on')")


def test_what_was_before_has_a_colour_where_it_hardly_matters(chromium: Any, quiet: Seen) -> None:
    with closing(ServedPage(Told(quiet).source())) as served, Look(chromium, served.address) as look:
        look.until("document.body.dataset.frames > 0")
        drawn = look.evaluate(
            """async () => {
                const { FogImage } = await import('/fogimage.js');
                const image = new FogImage(3, 1), drawn = [], seen = Int32Array.of(-1, -2, 595);
                image.base(Int32Array.of(3, 3, 3));
                const striped = () => drawn.push([...image.pixels].map((pixel, i) => pixel === image.unknown[i]));
                for (const [since, k] of [[0, 600], [3, 600], [590, 600], [590, 950]]) {
                    image.ages({ seen, since }, k, 300);
                    striped();
                    image.difference({ seen, since }, { seen: Int32Array.of(k, k, k) }, 60);
                    striped();
                }
                return drawn;
            }"""
        )
    for place, vague in enumerate((False, False, False, False, True, True, False, False)):
        assert drawn[place] == [vague, True, False]


class Slow(Told):
    """A wire whose world answers when it is told to."""

    def __init__(self, seen: Seen) -> None:
        super().__init__(seen)
        self.may_answer = threading.Semaphore(0)

    def ask(self, control: Mapping[str, Any]) -> Answer:
        answer = super().ask(control)
        assert self.may_answer.acquire(timeout=PATIENCE_S)
        return answer


def slide(look: Look, share: int) -> None:
    """Move the loss, and wait until the page takes it as meant."""
    look.evaluate(
        f"""() => {{ const loss = document.getElementById('loss'); loss.value = {share};
            loss.dispatchEvent(new Event('input', {{bubbles: true}}));
            return new Promise((done) => setTimeout(done, 400)); }}"""
    )


def test_there_is_one_loss_at_a_time_and_no_gap_however_slowly_a_world_answers(chromium: Any, quiet: Seen) -> None:
    wire = Slow(quiet)
    with closing(ServedPage(wire.source())) as served, Look(chromium, served.address) as look:
        look.until("document.body.dataset.frames > 0")
        look.page.click("#tab-faults")
        for share in (30, 40, 50):
            slide(look, share)
        assert [control["fault"]["rate"] for control in wire.asked] == [0.3]
        wire.may_answer.release()
        look.until("document.getElementById('answer').textContent === 'done'")
        slide(look, 60)
        wire.may_answer.release(2)
        look.until("document.getElementById('answer').textContent === 'done'")
        slide(look, 0)
        wire.may_answer.release(8)
        slide(look, 0)
    first, second, third, last = wire.asked
    assert [one["fault"]["rate"] for one in (first, second, third)] == [0.3, 0.5, 0.6]
    assert "instead" not in first
    assert second["instead"] == first["fault"]["id"]
    assert third["instead"] == second["fault"]["id"]
    assert last == {"do": "heal", "id": third["fault"]["id"]}


def test_of_a_direct_radio_the_page_says_what_nobody_knows(chromium: Any, direct: Seen) -> None:
    wire = Told(direct)
    with closing(ServedPage(wire.source())) as served, Look(chromium, served.address) as look:
        look.until("document.body.dataset.frames > 0")
        look.page.click("#tab-links")
        look.until("document.getElementById('linktip').textContent.includes('direct radio')")
        assert look.evaluate("document.getElementById('matrix').hidden")
        fogs = "[...document.getElementById('layer').options].map((one) => [one.value, one.disabled])"
        assert look.evaluate(fogs) == [["0", False], ["-1", False], ["d-1", False], ["", True]]
        shown = []
        for _ in range(3):
            look.press("l")
            shown.append(look.evaluate("document.getElementById('layer').value"))
        assert shown == ["-1", "d-1", "0"]


def test_a_chart_of_days_is_taken_and_stays_small(chromium: Any, quiet: Seen) -> None:
    with closing(ServedPage(Told(quiet).source())) as served, Look(chromium, served.address) as look:
        look.until("document.body.dataset.frames > 0")
        count, last, stalest, most = look.evaluate(
            """async () => {
                const { Store } = await import('/store.js');
                const store = new Store(() => {});
                const told = (from, to) => {
                    const k = Array.from({ length: to - from }, (_, i) => from + i);
                    store.take({ type: 'series', k, mfow: k.map((one) => one === 1234 ? 99 : one % 50), mean: k });
                };
                told(0, 300000);
                for (let k = 300000; k < 330000; k++) told(k, k + 1);
                const { k, mfow } = store.series;
                return [k.length, k.at(-1), store.stalest, Math.max(...mfow.slice(0, 2000))];
            }"""
        )
    assert count <= 10_000
    assert last > 329_990
    assert stalest == most == 99


def test_a_fog_and_its_state_change_together(chromium: Any, quiet: Seen) -> None:
    with closing(ServedPage(Told(quiet).source())) as served, Look(chromium, served.address) as look:
        look.until("document.body.dataset.frames > 0")
        ticks = look.evaluate(
            """async () => {
                const { Store } = await import('/store.js');
                const store = new Store(() => {}), seen = [];
                const look = () => seen.push(store.fog(3)?.tick ?? null);
                store.take({ type: 'static', width: 4, height: 4, side: 64, live: false });
                for (const [tick, k] of [[4, 4], [5, 5], [5, 9], [9, 9], [9, 2]]) {
                    store.unpack(Int32Array.of(3, tick, 0, 0, 0).buffer);
                    look();
                    store.take({ type: 'state', k, robots: [] });
                    look();
                }
                return seen;
            }"""
        )
    assert ticks == [None, 4, 4, 5, 5, None, None, 9, 9, None]
