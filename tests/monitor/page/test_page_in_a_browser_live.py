"""The page of a fleet that is running, in a real browser; its world is played here."""

import threading
from collections.abc import Callable, Mapping
from typing import Any

import pytest

from monitor.live.fog_tracker import FogTrackers
from monitor.observation.source import Answer
from runtime.messages.feed import Batch
from tests.browser import PATIENCE_S, Look, browser_or_skip
from tests.monitor.conftest import Seen
from tests.monitor.live.test_feed_source import FakeFeed
from tests.monitor.pages import look_at

pytestmark = browser_or_skip()

MIDDLE = {"x": 455, "y": 300}


def run_script(browser: Any, seen: Seen, script: str) -> Any:
    """Return what a script gives in the page of a fleet."""
    with look_at(browser, FakeFeed(seen).source()) as look:
        return look.evaluate(script)


def test_who_comes_late_sees_what_is_not_known_as_that(chromium: Any, quiet: Seen) -> None:
    wire = FakeFeed(quiet)
    wire.number = 61
    with look_at(chromium, wire.source()) as look:
        assert "known" not in look.evaluate("document.getElementById('legendtext').textContent")
        for fog in ("-1", "2", "d2"):
            look.page.select_option("#layer", fog)
            look.page.hover("#canvas", position=MIDDLE)
            look.until("document.getElementById('legendtext').textContent.endsWith('striped: unknown')")
            look.until("document.getElementById('tip').textContent.includes(' s (known since 30 s)')")


def test_what_was_before_has_a_colour_where_it_hardly_matters(chromium: Any, quiet: Seen) -> None:
    script = """async () => {
        const { FogImage } = await import('/fogimage.js');
        const image = new FogImage(3, 1), drawn = [], seen = Int32Array.of(-1, -2, 595);
        image.base(Int32Array.of(3, 3, 3));
        const striped = () => drawn.push([...image.pixels].map((pixel, i) => pixel === image.unknown[i]));
        for (const [since, k] of [[0, 600], [3, 600], [590, 600], [590, 950]]) {
            const fog = { seen, since, tick: k };
            image.ages(fog, 300);
            striped();
            image.difference(fog, { seen: Int32Array.of(k, k, k) }, 60);
            striped();
        }
        return drawn;
    }"""
    drawn = run_script(chromium, quiet, script)
    assert drawn == [[vague, True, False] for vague in (False, False, False, False, True, True, False, False)]


class Slow(FakeFeed):
    """A wire whose world answers when it is told to."""

    def __init__(self, seen: Seen) -> None:
        super().__init__(seen)
        self.came = threading.Semaphore(0)
        self.may_answer = threading.Semaphore(0)

    def control(self, control: Mapping[str, Any]) -> Answer:
        answer = super().control(control)
        self.came.release()
        assert self.may_answer.acquire(timeout=PATIENCE_S)
        return answer

    def hear(self) -> Mapping[str, Any]:
        """The next control that comes, in time."""
        assert self.came.acquire(timeout=PATIENCE_S)
        return self.asked[-1]


def slide(look: Look, share: int) -> None:
    """Move the loss, and wait until the page takes it as meant: its timer is older than this one, and no longer."""
    script = """() => { const loss = document.getElementById('loss'); loss.value = %d;
        loss.dispatchEvent(new Event('input', {bubbles: true}));
        return new Promise((done) => setTimeout(done, 400)); }"""
    look.evaluate(script % share)


def test_there_is_one_loss_at_a_time_and_no_gap_however_slowly_a_world_answers(chromium: Any, quiet: Seen) -> None:
    wire = Slow(quiet)
    with look_at(chromium, wire.source()) as look:
        look.page.click("#tab-faults")
        slide(look, 30)
        first = wire.hear()
        slide(look, 40)
        slide(look, 50)
        wire.may_answer.release()
        second = wire.hear()  # 40 % was wanted no more when the first was answered
        slide(look, 60)
        wire.may_answer.release()
        third = wire.hear()
        slide(look, 0)
        wire.may_answer.release()
        healed = wire.hear()
        slide(look, 10)
        wire.may_answer.release(2)
        last = wire.hear()
    assert [one["fault"]["rate"] for one in (first, second, third, last)] == [0.3, 0.5, 0.6, 0.1]
    assert "instead" not in first
    assert second["instead"] == first["fault"]["id"]
    assert third["instead"] == second["fault"]["id"]
    assert healed == {"do": "heal", "id": third["fault"]["id"]}
    assert "instead" not in last
    assert len(wire.asked) == 5


def test_a_loss_that_is_moved_before_a_state_is_told_is_asked_for_with_it(chromium: Any, quiet: Seen) -> None:
    script = """async () => {
        const { FaultsPanel } = await import('/panel_faults.js');
        const loss = document.getElementById('loss'), asked = [];
        const facts = { live: true, controls: ['fault'], robots: [] };
        const told = { robots: [], intruders: [], faults: [{ kind: 'loss', id: 'before', rate: 0.2 }] };
        let state = null, looks = 0;
        const store = { facts, listed: [], get state() { looks++; return state; } };
        const operate = (control) => {
            asked.push([control.fault.rate, control.instead]);
            return Promise.resolve(true);
        };
        const panel = new FaultsPanel({ store, map: { selected: -1 }, operate });
        const slide = (share) => { loss.value = share; loss.dispatchEvent(new Event('input')); };
        const turn = () => new Promise((done) => setTimeout(done, 10));
        const until = async (met) => { for (let i = 0; i < 1000 && !met(); i++) await turn(); };
        slide(30);
        await until(() => looks > 0);
        await turn();
        state = told;
        panel.update('state');
        await until(() => asked.length === 1);
        await turn();
        slide(40);
        await until(() => asked.length === 2);
        return asked.map(([rate, instead]) => [rate, instead.split('-')[0]]);
    }"""
    asked = run_script(chromium, quiet, script)
    assert asked == [[0.3, "before"], [0.4, "loss"]]


def test_of_a_direct_radio_the_page_says_what_nobody_knows(chromium: Any, direct: Seen) -> None:
    wire = FakeFeed(direct)
    with look_at(chromium, wire.source()) as look:
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
    script = """async () => {
        const { Store } = await import('/store.js');
        const store = new Store(() => {});
        const told = (from, to) => {
            const k = Array.from({ length: to - from }, (_, i) => from + i);
            const falling = (one) => (one === 1234 ? 99 : 50 - (one % 50));
            store.receive({ type: 'series', k, mfow: k.map(falling), mean: k });
            newest &&= store.series.k.at(-1) === to - 1;
        };
        let newest = true;
        told(0, 300000);
        for (let k = 300000; k < 330000; k += 25) told(k, k + 25);
        const { k, mfow } = store.series;
        return [k.length, newest, store.stalest, Math.max(...mfow.slice(0, 2000))];
    }"""
    count, newest, stalest, most = run_script(chromium, quiet, script)
    assert count <= 10_000
    assert newest
    assert stalest == most == 99


def test_a_fog_and_its_state_change_together_but_for_a_little_lag(chromium: Any, quiet: Seen) -> None:
    script = """async () => {
        const { Store } = await import('/store.js');
        return [0, 2].map((late) => {
            const store = new Store(() => {}), seen = [];
            const look = () => seen.push(store.fog(3)?.tick ?? null);
            store.receive({ type: 'static', width: 4, height: 4, side: 64, live: false, late });
            for (const [tick, k] of [[4, 4], [5, 5], [5, 7], [5, 8], [9, 9], [9, 2]]) {
                store.unpack(Int32Array.of(3, tick, 0, 0, 0).buffer);
                look();
                store.receive({ type: 'state', k, robots: [] });
                look();
            }
            return seen;
        });
    }"""
    strict, lax = run_script(chromium, quiet, script)
    assert strict == [None, 4, 4, 5, 5, None, None, None, None, 9, 9, None]
    assert lax == [None, 4, 4, 5, 5, 5, 5, None, None, 9, 9, None]


def test_a_belief_that_lags_is_held_against_the_truth_of_its_own_tick(chromium: Any, quiet: Seen) -> None:
    script = """async () => {
        const { FogImage } = await import('/fogimage.js');
        const image = new FogImage(4, 1);
        image.base(Int32Array.of(3, 3, 3, 3));
        const believed = { seen: Int32Array.of(10, 10, 50, 60), since: 0, tick: 60 };
        image.difference(believed, { seen: Int32Array.of(61, 10, 60, 60) }, 20);
        const [later, same, older, newest] = image.pixels;
        return [later === image.unknown[0], same === newest, older !== same && older !== image.unknown[2]];
    }"""
    drawn = run_script(chromium, quiet, script)
    assert drawn == [True, True, True]


def test_a_map_with_more_points_than_the_screen_has_pixels_is_drawn_from_some(chromium: Any, quiet: Seen) -> None:
    script = """async () => {
        const { FogImage } = await import('/fogimage.js');
        const image = new FogImage(5, 3, 2);
        const terrain = new Int32Array(15).fill(3);
        terrain[1 * 5 + 1] = 0;
        image.base(terrain);
        const wall = image.pixels[1 * 3 + 0];
        const fog = { seen: new Int32Array(15).fill(60), since: 0, tick: 60 };
        fog.seen[1 * 5 + 3] = 5;
        image.ages(fog, 20);
        const [a, b, c, d, e, f] = image.pixels;
        const { width, height } = image.canvas;
        return [[width, height], [d === wall, e === wall], [e === f, a === b, b === c]];
    }"""
    size, walls, seen = run_script(chromium, quiet, script)
    assert size == [3, 2]  # row 0 is at the bottom
    assert walls == [True, False]
    assert seen == [False, True, True]


class Timed(FakeFeed):
    """A wire on which time goes by also where nobody waits."""

    def batch(self, timeout_s: float) -> Batch | None:
        self.now += 0.01
        return super().batch(timeout_s)


def test_a_belief_that_lags_is_shown_and_says_so(chromium: Any, quiet: Seen, monkeypatch: pytest.MonkeyPatch) -> None:
    behind, catch_up = threading.Event(), FogTrackers.catch_up

    def lagging(followers: FogTrackers, over: Callable[[], bool]) -> None:
        """Up to four ticks behind, if so."""

        def enough() -> bool:
            return behind.is_set() and any(one.late == 4 for one in followers._by_layer.values())

        if not enough():
            catch_up(followers, lambda: over() or enough())

    monkeypatch.setattr(FogTrackers, "catch_up", lagging)
    wire = Timed(quiet)
    caption, tip = (f"document.getElementById('{name}').textContent" for name in ("legendtext", "tip"))
    with look_at(chromium, wire.source()) as look:
        look.page.select_option("#layer", "2")
        look.page.hover("#canvas", position=MIDDLE)
        wire.send(20)
        look.until(f"/seen .* ago$/.test({tip}) && !{caption}.includes('as of')")
        behind.set()
        wire.send(60)
        look.until(f"{caption} === 'seconds since last seen, as of 2.0 s ago' && /as of 2.0 s ago.$/.test({tip})")
        look.page.select_option("#layer", "d2")
        look.until(f"{caption} === 'believed minus true age (s), as of 2.0 s ago; striped: unknown'")
