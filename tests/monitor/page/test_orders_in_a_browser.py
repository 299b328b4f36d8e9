"""The page of robots without a world, in a real browser: an operator stops them all and is told how they stand."""

import time
from typing import Any

import pytest

from patrol.pose import Pose
from runtime.messages.telemetry import Telemetry, pack_view
from tests.browser import browser_or_skip
from tests.monitor.live.test_positions_source import KEYS, Ears, hear, source_of
from tests.monitor.pages import look_at

pytestmark = browser_or_skip()


class Moving(list[float]):
    """A clock that goes, as a source looks at it."""

    def __getitem__(self, _: Any) -> Any:
        return time.monotonic()


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (1280, "dark"), (390, "light")])
def test_an_operator_of_real_robots_stops_all_from_the_header(chromium: Any, width: int, scheme: str) -> None:
    ears, clock = Ears(), Moving()
    source = source_of(ears, clock, may_stop=True)
    stopped = "stopped by an operator (fogwatch control ... release)"
    hear(ears, "anna", 0, Pose(6.0, 6.0, 0.0))
    report = Telemetry(0, "patrolling", None, None, None, 9, 1.5, 0, stopped=stopped)
    ears.subscribed[KEYS.telemetry("*")].deliver(KEYS.telemetry("anna"), pack_view(report))
    with look_at(chromium, source, width=width, scheme=scheme) as look:
        look.until("document.querySelector('header #stopall').offsetParent !== null")
        look.page.click("#stopall")
        look.until("document.getElementById('ordered').textContent.includes('bert: no answer; use another way')")
        look.until("document.getElementById('rows').textContent.includes('stopped by an operator')")
        assert look.evaluate("document.documentElement.scrollWidth <= window.innerWidth")


def test_a_page_that_only_looks_offers_no_orders(chromium: Any) -> None:
    with look_at(chromium, source_of(Ears(), Moving())) as look:
        look.until("document.getElementById('mode').textContent === 'live'")
        assert look.evaluate("document.getElementById('orders').hidden")
