"""The charge of batteries in the page's table of robots, in a real browser: replayed, live, and as robots report it."""

from pathlib import Path
from typing import Any

import pytest

from monitor.replay.player import Player
from patrol.pose import Pose
from runtime.messages.telemetry import Telemetry, pack_view
from tests.browser import browser_or_skip
from tests.monitor.conftest import QUIET, Seen, run_of
from tests.monitor.live.test_feed_source import FakeFeed
from tests.monitor.live.test_positions_source import KEYS, Ears, hear, source_of
from tests.monitor.page.test_orders_in_a_browser import Moving
from tests.monitor.pages import look_at

pytestmark = browser_or_skip()

STEP_S, CAPACITY_J, IDLE_W = 0.5, 3600.0, 45.0
"""A battery of 1 Wh, of which a robot uses 0.625 % in a tick."""
BATTERY = {"capacity": 1.0, "start": 0.9, "idle": IDLE_W, "drive": 0.0, "charge": 100.0}
ROBOTS = [{"name": "r1", "model": "holonomic", "battery": BATTERY}, {"name": "r2", "model": "holonomic"}]
SHOWN = "[...document.querySelectorAll('#rows td:last-child')].map((cell) => cell.innerText)"


def left(k: int) -> str:
    """The charge after a tick."""
    return f"{100 * (BATTERY['start'] - IDLE_W * STEP_S * (k + 1) / CAPACITY_J):.0f} %"


@pytest.fixture(scope="module")
def charged(tmp_path_factory: pytest.TempPathFactory) -> Seen:
    return run_of(tmp_path_factory.mktemp("charged"), {**QUIET, "step": STEP_S, "robots": ROBOTS})


def test_a_replay_shows_the_charge_at_its_time(chromium: Any, charged: Seen) -> None:
    with look_at(chromium, Player(charged.open())) as look:
        for k in (0, 60, 21):
            look.seek(k)
            look.until(f"{SHOWN}.join() === '{left(k)},-'")
    assert (left(0), left(60)) == ("89 %", "52 %")


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (1280, "dark"), (390, "light")])
def test_a_late_viewer_sees_the_charge_of_a_run(chromium: Any, charged: Seen, width: int, scheme: str) -> None:
    wire = FakeFeed(charged)
    wire.number = 41  # header, then ticks 0 to 39
    with look_at(chromium, wire.source(), width=width, scheme=scheme) as look:
        look.until(f"{SHOWN}.join() === '{left(39)},-'")
        wire.send(21)
        look.until(f"{SHOWN}.join() === '{left(60)},-'")
        assert look.evaluate("document.documentElement.scrollWidth <= window.innerWidth")


def test_robots_without_a_world_report_their_charge(chromium: Any) -> None:
    ears = Ears()
    source = source_of(ears, Moving())
    hear(ears, "anna", 0, Pose(6.0, 6.0, 0.0))
    report = Telemetry(0, "patrolling", None, None, None, 9, 1.5, 0, charge=0.375)
    ears.subscribed[KEYS.telemetry("*")].deliver(KEYS.telemetry("anna"), pack_view(report))
    with look_at(chromium, source) as look:
        look.until(f"{SHOWN}[0] === '38 %'")


def test_without_batteries_there_is_no_column(chromium: Any, tmp_path: Path) -> None:
    with look_at(chromium, Player(run_of(tmp_path, {**QUIET, "duration": 5}).open())) as look:
        look.until("document.getElementById('charge').hidden")
        assert look.evaluate("document.querySelector('#rows td:last-child').hidden")
