"""The page of a patrol with zones, in a real browser: what is in force, and switching it."""

from itertools import combinations
from pathlib import Path
from typing import Any

import pytest

from monitor.replay.player import Player
from patrol.journal.records import Event
from patrol.scenario.controls import OPERATOR
from tests.browser import browser_or_skip
from tests.monitor.conftest import DOORS, QUIET, Seen, run_of
from tests.monitor.live.test_feed_source import FakeFeed
from tests.monitor.pages import NOTE_LABELS, look_at

pytestmark = browser_or_skip()

ZONES: list[dict[str, Any]] = [
    {"name": "vault", "polygon": [[2, 2], [40, 2], [40, 30], [2, 30]], "weight": 10, "times": [[10, 20]]},
    {"name": "ward", "polygon": [[50, 40], [90, 40], [90, 80], [50, 80]], "speed": 0.5},
    {"name": "stairs", "polygon": [[44, 30], [48, 30], [48, 34], [44, 34]], "keep_out": True},
]
LISTED = "[...document.querySelectorAll('#zonelist li')].map((one) => one.innerText.split('\\n').join('|'))"


@pytest.fixture(scope="module")
def zoned(tmp_path_factory: pytest.TempPathFactory) -> Seen:
    closures = DOORS["closures"]
    return run_of(tmp_path_factory.mktemp("zoned"), {**QUIET, "name": "zoned", "zones": ZONES, "closures": closures})


def test_a_replay_lists_the_zones_and_which_are_in_force_at_its_time(chromium: Any, zoned: Seen) -> None:
    with look_at(chromium, Player(zoned.open())) as look:
        look.page.click("#tab-zones")
        for k, held in ((4, "not in force"), (30, "in force"), (60, "not in force")):
            look.seek(k)
            look.until(f"{LISTED}[0] === 'vault x10|{held}'")
        assert look.evaluate(LISTED)[1:] == ["ward 0.5 m/s|in force", "stairs: keep out|in force"]
        assert look.evaluate("document.querySelectorAll('#zonelist button').length") == 0


@pytest.mark.parametrize("width", [1280, 390])
def test_an_operator_switches_a_zone(chromium: Any, zoned: Seen, width: int) -> None:
    wire = FakeFeed(zoned)
    with look_at(chromium, wire.source(), width=width) as look:
        look.page.click("#tab-zones")
        look.until(f"{LISTED}[1] === 'ward 0.5 m/s|in force|switch off'")
        assert look.evaluate(LISTED)[::2] == ["vault x10|not in force|switch on", "stairs: keep out|in force"]
        look.page.click("[aria-label='switch ward']")
        look.until("document.getElementById('zonesanswer').innerText === 'done'")
        look.page.click("[aria-label='switch vault']")
        assert look.page.is_visible("#tab-closures")
        assert look.evaluate("document.documentElement.scrollWidth") <= width
    assert wire.asked == [{"do": "zone", "name": name, "on": on} for name, on in (("ward", False), ("vault", True))]


@pytest.mark.parametrize("width", [1280, 390])
def test_an_operator_changes_a_weight(chromium: Any, zoned: Seen, width: int) -> None:
    wire = FakeFeed(zoned)
    zone = '{"do":"zone","name":"vault",%s}'
    wire.asked_for = [Event(0, OPERATOR, None, zone % change) for change in ('"on":true', '"weight":3')]
    with look_at(chromium, wire.source(), width=width) as look:
        look.page.click("#tab-zones")
        look.until(f"{LISTED}[0] === 'vault x3|in force|switch off'")
        look.page.fill("[aria-label='weight of vault']", "0.5")
        look.page.press("[aria-label='weight of vault']", "Enter")
        look.until("document.getElementById('zonesanswer').innerText === 'done'")
        assert look.evaluate("document.querySelectorAll('#zonelist input').length") == 1
        assert look.evaluate("document.documentElement.scrollWidth") <= width
    assert wire.asked == [{"do": "zone", "name": "vault", "weight": 0.5}]


def test_a_weight_is_given_by_enter_alone_and_not_where_it_holds_already(chromium: Any, zoned: Seen) -> None:
    wire, weight, field = FakeFeed(zoned), "[aria-label='weight of vault']", "document.querySelector('#zonelist input')"
    with look_at(chromium, wire.source()) as look:
        look.page.click("#tab-zones")
        look.until(f"{field}?.value === '10'")
        look.page.press(weight, "Enter")
        look.page.press(weight, "ArrowUp")
        assert look.evaluate(f"{field}.value") == "11"
        look.page.press(weight, "Tab")
        assert look.evaluate(f"{field}.value") == "10"
        look.page.fill(weight, "7")
        look.page.press(weight, "Tab")
        look.page.fill(weight, "5")
        look.page.press(weight, "Enter")
        look.until("document.getElementById('zonesanswer').innerText === 'done'")
    assert wire.asked == [{"do": "zone", "name": "vault", "weight": 5}]


def test_a_zone_that_is_not_in_force_shows_the_weight_that_would_hold(chromium: Any, tmp_path: Path) -> None:
    vault = ZONES[0] | {"times": [], "weights": [[2, 4]]}
    asleep = run_of(tmp_path, {**QUIET, "name": "asleep", "zones": [vault]})
    with look_at(chromium, Player(asleep.open())) as look:
        look.page.click("#tab-zones")
        for k, label in ((1, "vault x10"), (9, "vault x4")):
            look.seek(k)
            look.until(f"{LISTED}[0] === '{label}|not in force'")


def test_with_no_zone_in_force_each_can_be_switched_on(chromium: Any, tmp_path: Path) -> None:
    asleep = run_of(tmp_path, {**QUIET, "name": "asleep", "zones": [{**ZONES[1], "times": []}]})
    wire = FakeFeed(asleep)
    with look_at(chromium, wire.source()) as look:
        look.page.click("#tab-zones")
        look.until(f"{LISTED}[0] === 'ward 0.5 m/s|not in force|switch on'")
        wire.send(len(wire.records))
        look.until("document.querySelector('#zonelist button').disabled")


def test_what_was_switched_before_a_viewer_came_is_shown(chromium: Any, zoned: Seen) -> None:
    wire = FakeFeed(zoned)
    wire.asked_for = [Event(0, OPERATOR, None, '{"do":"zone","name":"vault","on":true}')]
    with look_at(chromium, wire.source(), plain=True) as look:
        look.page.click("#tab-zones")
        look.until(f"{LISTED}[0] === 'vault x10|in force'")
        buttons = look.evaluate("document.querySelectorAll('#zonelist button').length")
        assert buttons == 0, "without the right to control"


def test_without_zones_and_closures_there_are_no_such_tabs(chromium: Any, quiet: Seen) -> None:
    with look_at(chromium, FakeFeed(quiet).source()) as look:
        assert not any(look.page.is_visible(tab) for tab in ("#tab-zones", "#tab-closures"))
        assert look.page.is_visible("#tab-faults")


def test_the_label_of_a_zone_at_the_rim_is_not_cut_off(chromium: Any, tmp_path: Path) -> None:
    zone = {"name": "the-treasury-in-the-north-wing", "polygon": [[92, 2], [100, 2], [100, 10], [92, 10]], "speed": 0.5}
    rim = run_of(tmp_path, {**QUIET, "name": "rim", "zones": [zone]})
    with look_at(chromium, Player(rim.open()), width=390) as look:
        look.evaluate(NOTE_LABELS)
        look.seek(9)
        look.until("window.labels.some(([text]) => text.startsWith('the-treasury'))")
        labels = look.evaluate("window.labels.filter(([text]) => text.startsWith('the-treasury'))")
        assert {(text, fits) for text, fits in labels} == {("the-treasury-in-the-north-wing 0.5 m/s", True)}


@pytest.mark.parametrize("width", [1280, 390])
def test_labels_do_not_lie_on_each_other_and_those_of_robots_stay(chromium: Any, tmp_path: Path, width: int) -> None:
    """Eight zones with one centre: only some of their labels find a free place."""
    rings = [[80 - side, 20 - side, 80 + side, 20 + side] for side in range(4, 20, 2)]
    zones = [
        {"name": f"ward-{number}", "polygon": [[x0, y0], [x1, y0], [x1, y1], [x0, y1]], "weight": 2 + number}
        for number, (x0, y0, x1, y1) in enumerate(rings)
    ]
    robots = {"count": 3, "model": "holonomic", "starts": [[30, 20], [60, 56], [63, 56]]}
    crowded = run_of(tmp_path, {**QUIET, "name": "crowded", "zones": zones, "robots": robots})
    with look_at(chromium, Player(crowded.open()), width=width) as look:
        look.evaluate(NOTE_LABELS)
        look.seek(3)
        look.until("document.getElementById('clock').title === 'tick 3' && 'r3' in window.boxes")
        # Another frame of the same tick: `boxes` may still hold labels of the one before.
        look.evaluate("window.boxes = {}; window.dispatchEvent(new Event('resize'))")
        look.until("'r3' in window.boxes")
        boxes = look.evaluate("window.boxes")
    assert {"r1", "r2", "r3"} < set(boxes)
    assert 0 < sum(name.startswith("ward") for name in boxes) < len(zones)
    for (one, a), (other, b) in combinations(boxes.items(), 2):
        overlaps = min(a[2], b[2]) > max(a[0], b[0]) and min(a[3], b[3]) > max(a[1], b[1])
        assert not overlaps, (one, other)
