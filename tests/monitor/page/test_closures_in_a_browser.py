"""Closures on the page, in a real browser: what is closed, what waits, and an operator who closes and opens."""

import json
from collections.abc import Mapping
from typing import Any

import pytest

from monitor.observation.source import Answer
from monitor.replay.player import Player
from patrol.journal import unpack
from patrol.journal.records import Event
from patrol.scenario.controls import OPERATOR
from tests.browser import Look, browser_or_skip
from tests.monitor.conftest import Seen
from tests.monitor.live.test_feed_source import FakeFeed
from tests.monitor.pages import look_at, pixels

pytestmark = browser_or_skip()

STATES = "[...document.querySelectorAll('#closurelist span')].map((one) => one.textContent).join()"
ORANGE = pixels("d[i] === 224 && d[i + 1] === 123 && d[i + 2] === 0")
"""Counts the pixels of the map that have the colour of closed ground."""
HELD = "[...document.querySelectorAll('#closurelist [aria-pressed=true]')].map((one) => one.ariaLabel).join()"


class Echo(FakeFeed):
    """A wire whose world answers with what it was asked for."""

    def control(self, control: Mapping[str, Any]) -> Answer:
        return Answer(True, json.dumps(control))


def asks(look: Look, control: Mapping[str, Any]) -> None:
    """Wait until the page shows the answer to a control."""
    look.until(f"document.getElementById('closuresanswer').textContent === {json.dumps(control)!r}")


def shows(look: Look, states: str, held: str = "") -> None:
    """Wait until the panel shows the states of gate and crate, and which buttons are pressed."""
    look.until(f"{STATES} === {states!r} && {HELD} === {held!r}")


def send_until(wire: FakeFeed, k: int) -> None:
    """Send all records up to those before tick k."""
    ticks = [getattr(unpack(record), "k", k) for record in wire.records]
    wire.send(next(i for i, tick in enumerate(ticks) if i and tick >= k) - wire.number)


@pytest.mark.parametrize("width", [1280, 390])
def test_an_operator_closes_and_opens_and_takes_it_back(chromium: Any, doors: Seen, width: int) -> None:
    wire = Echo(doors)
    with look_at(chromium, wire.source(), width=width, height=844) as look:
        look.page.focus("#tab-robots")
        look.press("ArrowLeft")
        shows(look, "open,open")
        assert look.evaluate("document.documentElement.scrollWidth") <= width
        look.page.focus("[aria-label='close crate']")
        look.press("Enter")
        asks(look, {"do": "fault", "fault": {"kind": "close", "closure": "crate"}})
        send_until(wire, 23)
        shows(look, "held open,waits until robots have left", "open gate,close crate")
        look.page.focus("[aria-label='close crate']")
        look.press(" ")
        asks(look, {"do": "heal", "id": "op2"})
        look.page.click("[aria-label='close gate']")
        asks(look, {"do": "fault", "fault": {"kind": "close", "closure": "gate"}})
        send_until(wire, 29)
        shows(look, "closed,held closed", "close crate")
        send_until(wire, 80)
        shows(look, "open,open")


def test_of_several_in_force_the_one_that_began_last_is_shown_as_held(chromium: Any, doors: Seen) -> None:
    wire = FakeFeed(doors)
    for fault in ('"kind":"close","closure":"crate","at":4', '"kind":"open","closure":"crate"'):
        wire.asked_for.append(Event(0, OPERATOR, None, f'{{"do":"fault","fault":{{{fault}}}}}'))
    with look_at(chromium, wire.source()) as look:
        look.page.click("#tab-closures")
        send_until(wire, 6)
        shows(look, "open,held open", "open crate")
        send_until(wire, 8)
        shows(look, "open,closes with the next tick", "close crate")
        send_until(wire, 10)
        shows(look, "open,open", "close crate")  # this world knows of no fault, so the page does not say that it closes


def test_a_page_without_a_key_shows_what_is_held_and_offers_nothing(chromium: Any, doors: Seen) -> None:
    wire = FakeFeed(doors)
    with look_at(chromium, wire.source(), plain=True) as look:
        send_until(wire, 29)
        look.page.click("#tab-closures")
        shows(look, "closed,held closed")
        assert not look.evaluate("document.querySelectorAll('#closurelist button').length")
        assert "Press" not in look.evaluate("document.getElementById('closureshelp').textContent")


def test_a_replay_shows_what_was_closed_and_held(chromium: Any, doors: Seen) -> None:
    with look_at(chromium, Player(doors.open())) as look:
        look.page.click("#tab-closures")
        for k, states, orange in (
            (28, "closed,held closed", "> 5000"),
            (22, "held open,waits until robots have left", "< 300"),
            (60, "open,open", "< 300"),
        ):
            look.seek(k)
            shows(look, states)
            look.until(f"{ORANGE} {orange}")
        look.seek(35)
        shows(look, "open,held closed")
        look.until(f"{ORANGE} > 300 && {ORANGE} < 5000")
        shut = look.evaluate(
            """async () => {
                const { Store } = await import('/store.js');
                const store = new Store(() => {});
                const marks = [{ name: 'gate', runs: [[5, 2]] }, { name: 'door', runs: [[1, 1], [9, 1]] }];
                store.receive({ type: 'static', width: 4, height: 3, live: false, marks });
                return [['gate'], ['door', 'gate'], []].map((closed) => {
                    const looks = Object.fromEntries(closed.map((name) => [name, [name, true, true, false, null]]));
                    store.receive({ type: 'state', k: 1, robots: [], looks: { closures: looks } });
                    return [...store.shut].sort((one, other) => one[0] - other[0]).join(' ');
                });
            }"""
        )
        assert shut == ["5,gate 6,gate", "1,door 5,gate 6,gate 9,door", ""]
