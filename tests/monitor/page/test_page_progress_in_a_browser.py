"""The page's words on a patrol that gets nowhere and on what has not been seen, in a real browser."""

from contextlib import closing
from typing import Any

import pytest

from monitor.page.maps import survey_of
from monitor.replay.player import Player
from tests.browser import Look, browser_or_skip
from tests.monitor.conftest import Seen
from tests.monitor.live.test_feed_source import FakeFeed
from tests.monitor.pages import NOTE_LABELS, ServedPage, look_at, pixels

pytestmark = browser_or_skip()

SIZES = [(1280, 800), (800, 600), (390, 800)]
NEVER_SEEN, TRAPPED = (
    pixels(f"d[i] === {red} && d[i + 1] === {green} && d[i + 2] === {blue}")
    for red, green, blue in ((176, 48, 106), (193, 18, 31))
)
"""Count the pixels of the map that have the colour of unseen ground, and of a trapped robot."""


def text(name: str) -> str:
    """A script that gives the text of an element."""
    return f"document.getElementById({name!r}).textContent"


def hidden(name: str) -> str:
    """A script that says whether an element is hidden."""
    return f"document.getElementById({name!r}).hidden"


def test_ground_that_nobody_has_seen_looks_like_no_other(chromium: Any, trapped: Seen) -> None:
    run = trapped.open()
    with look_at(chromium, Player(run)) as look:
        unseen = []
        for k in (0, 100, run.ticks - 1):
            look.seek(k)
            share = 100.0 * int(run.seen[k]) / int(run.prepared.patrolled.sum())
            look.until(f"{text('seen')} === '{int(share * 10) / 10:.1f} %' && !{hidden('seenbox')}")
            look.until(f"!{hidden('neverkey')}")
            unseen.append(look.evaluate(NEVER_SEEN))
        look.page.select_option("#layer", "d1")
        look.until(hidden("neverkey"))
    assert unseen[0] > unseen[1] > unseen[2] > 0


def test_only_what_was_certainly_never_seen_is_dotted(chromium: Any, quiet: Seen) -> None:
    script = """async () => {
        const { FogImage } = await import('/fogimage.js');
        const image = new FogImage(3, 1);
        image.base(Int32Array.of(3, 3, 1));
        const drawn = (...seen) => image.ages({ seen: Int32Array.from(seen), since: 0, tick: 9 }, 10);
        return [drawn(-1, 4, -1), drawn(3, 4, -1), drawn(3, -2, -1)];
    }"""
    with look_at(chromium, Player(quiet.open())) as look:
        look.until(f"!{hidden('seenbox')}")
        assert look.evaluate(script) == [True, False, False]


def test_the_stalest_point_has_a_mark_and_the_page_says_where(chromium: Any, trapped: Seen) -> None:
    run = trapped.open()
    terrain = run.prepared.terrain
    with look_at(chromium, Player(run)) as look:
        assert look.evaluate(hidden("stalestbox"))  # nothing is stale at the beginning
        for k in (390, 40):
            look.seek(k)
            found = survey_of(trapped.truth[k], run.prepared.patrolled, k)
            assert found is not None
            x, y = terrain.centre(found.row, found.col)
            look.until(f"{text('stalest')} === '{x:.1f}, {y:.1f} m'")
            marked = look.evaluate(
                f"""async () => {{
                    const {{ drawLabels, drawStalest }} = await import('/marks.js');
                    const drawn = [];
                    const context = new Proxy({{}}, {{
                        get: (_, name) => (...values) => {{
                            if (name === 'fillText') drawn.push(values);
                            return {{ width: 10 }};  // of a text
                        }},
                        set: () => true,
                    }});
                    const stalest = [{x}, {y}, {k * run.step}, false];
                    const canvas = {{ width: 200, height: 200 }}, store = {{ state: {{ stalest }} }};
                    const toScreen = (x, y) => [x, y], taken = [], labels = [];
                    const map = {{ context, canvas, ratio: 1, store, taken, labels, toScreen }};
                    drawStalest(map);
                    drawLabels(map);
                    return drawn;
                }}"""
            )
            assert marked == [[f"never seen, {k * run.step:.0f} s", x, y + 24]]


def test_a_trapped_robot_is_marked_listed_and_in_the_events(chromium: Any, trapped: Seen) -> None:
    row = "document.querySelectorAll('#rows tr')[1].textContent"
    with look_at(chromium, Player(trapped.open())) as look:
        look.seek(380)
        look.until(f"{row}.includes('trapped since 0.0 s')")
        assert look.evaluate(TRAPPED) > 20
        look.page.click("#tab-events")
        look.until(f"/180 s *r2 trapped within .* since 0 s; nobody has seen .* in that time/.test({text('list')})")
        look.until(f"/195 s *r2 no longer trapped after 195 s/.test({text('list')})")
        times = "[...document.querySelectorAll('#list li')].map((one) => Number(one.dataset.k))"
        assert look.evaluate(times) == sorted(look.evaluate(times), reverse=True)
        look.seek(300)
        look.page.click("#tab-robots")
        look.until(f"!{row}.includes('trapped')")
        assert look.evaluate(TRAPPED) == 0


def test_a_live_page_says_it_too(chromium: Any, trapped: Seen) -> None:
    wire = FakeFeed(trapped)
    with look_at(chromium, wire.source()) as look:
        wire.send(385)
        look.until("document.querySelectorAll('#rows tr')[1].textContent.includes('trapped since 0.0 s')")
        look.until(f"{text('list')}.includes('r2 trapped')")
        assert not look.evaluate(hidden("stalestbox"))


def test_what_happened_before_a_page_connected_is_said_where_it_matters(chromium: Any, quiet: Seen) -> None:
    wire = FakeFeed(quiet)
    wire.number = 61
    with look_at(chromium, wire.source()) as look:
        assert look.evaluate(hidden("note"))
        look.page.click("#tab-links")
        wire.send(5)
        look.until(f"{text('linktip')}.endsWith('; counted from 30 s on')")


def test_spare_robots_appear_when_they_join(chromium: Any, spare: Seen) -> None:
    wire = FakeFeed(spare)
    rows = "[...document.querySelectorAll('#rows tr')].filter((one) => !one.hidden)"
    names = f"{rows}.map((one) => one.cells[0].innerText)"
    fogs, robots = (f"[...document.getElementById('{of}').options].map((one) => one.text)" for of in ("layer", "who"))
    source = wire.source()
    wire.send(15)
    with look_at(chromium, source) as look:
        assert look.evaluate(names) == ["r1", "r2"]
        assert "belief of r3" not in look.evaluate(fogs)
        assert look.evaluate(robots) == ["r1", "r2"]
        assert look.evaluate("document.getElementById('who').value") == "0"
        look.page.select_option("#layer", "2")
        for _ in range(2):
            look.press("p")
        look.until("document.querySelector('#rows .chosen')?.innerText.startsWith('r1')")
        look.page.click("#tab-faults")
        assert look.page.is_visible("#join")
        wire.send(15)
        look.page.click("#tab-robots")
        look.until(f"{names}.join() === 'r1,r2,r3'")
        assert "belief of r3" in look.evaluate(fogs)
        assert look.evaluate(robots) == ["r1", "r2", "r3"]
        assert look.evaluate("document.getElementById('layer').value") == "2"


def test_a_replay_plays_as_soon_as_it_is_looked_at(chromium: Any, quiet: Seen) -> None:
    player = Player(quiet.open(), autoplay=True)
    with closing(ServedPage(player)) as served, Look(chromium, served.address) as look:
        look.until("Number(document.getElementById('seek').value) > 0")
        assert look.evaluate(text("play")) == "pause"


@pytest.mark.parametrize(("time", "tick"), [("20", 40), ("0:12.5", 25), ("99:00", 79)])
def test_an_address_may_hold_the_time_at_which_a_replay_opens(chromium: Any, quiet: Seen, time: str, tick: int) -> None:
    player = Player(quiet.open(), autoplay=True)
    with closing(ServedPage(player)) as served, Look(chromium, f"{served.address}&t={time}") as look:
        look.until(f"document.getElementById('clock').title === 'tick {tick}'")
        look.until(f"{text('play')} === 'play'")
        assert look.evaluate("location.search") == f"?t={time}"


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_labels_stay_within_the_map(chromium: Any, edges: Seen, width: int, height: int) -> None:
    with look_at(chromium, Player(edges.open()), width=width, height=height) as look:
        look.evaluate(NOTE_LABELS)
        look.seek(3)
        look.evaluate("window.labels.length = 0")
        look.seek(0)
        look.until("new Set(window.labels.map(([text]) => text)).size >= 5")
        drawn = dict(look.evaluate("window.labels"))
        assert {"top", "topmost-left", "lowest-right", "bottom"} < set(drawn)
        assert all(drawn.values()), drawn


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_nothing_lies_over_anything_else(chromium: Any, trapped: Seen, width: int, height: int) -> None:
    with look_at(chromium, Player(trapped.open()), width=width, height=height) as look:
        look.seek(380)
        look.until("document.querySelectorAll('#rows tr')[1].textContent.includes('trapped')")
        over = """() => {
            const boxes = [...document.querySelectorAll('#layer, #legendtext, #neverkey, #scale, #ticks, .zoom button,'
                + 'header .numbers div, header h1, .transport > *, #rows tr:last-child td')]
                .filter((one) => one.offsetParent).map((one) => [one.id || one.innerText, one.getBoundingClientRect()]);
            return boxes.flatMap(([name, a], i) => boxes.slice(i + 1).filter(([, b]) =>
                Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1
                && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1).map(([other]) => [name, other]));
        }"""
        assert look.evaluate(over) == []
        assert look.evaluate("document.documentElement.scrollWidth") <= width
