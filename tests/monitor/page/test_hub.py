"""Messages that the hub sends of a source, to viewers that are played here."""

import asyncio
import json
import math
from array import array
from contextlib import closing
from typing import Any

import numpy as np
import pytest

from monitor.live.fog_tracker import KEPT_S
from monitor.observation.source import Series
from monitor.page.hub import MOST_POINTS, Hub, Viewer
from monitor.page.messages import static_message, thinned
from monitor.replay.past_beliefs import PastBeliefs
from monitor.replay.player import Player
from patrol.closures.spec import closure_points
from tests.monitor.conftest import Seen
from tests.monitor.live.test_feed_source import FakeFeed


@pytest.fixture(autouse=True)
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have each turn work out all that it asks for, however slow the machine is."""
    monkeypatch.setattr("monitor.replay.past_beliefs.BUDGET_S", math.inf)
    monkeypatch.setattr("monitor.replay.run_log.BUDGET_S", math.inf)


class Page:
    """A page that is never opened: what one turn of the hub after the other sends it."""

    def __init__(self, hub: Hub) -> None:
        self.viewer = Viewer(asyncio.new_event_loop())
        self.hub = hub
        hub.add(self.viewer)

    def close(self) -> None:
        self.viewer.loop.close()

    def messages(self) -> list[Any]:
        """Messages that it gets now, and has drawn; packets as (layer, tick, since, tiles)."""
        self.hub.turn()
        loop = self.viewer.loop
        loop.call_soon(loop.stop)
        loop.run_forever()
        found: list[Any] = []
        while not self.viewer.outbox.empty():
            for message in self.viewer.outbox.get_nowait() or ():
                if isinstance(message, bytes):
                    found.append(tuple(array("i", message[:16])))
                else:
                    found.append(json.loads(message))
            self.viewer.written += 1
        self.viewer.drawn = True
        return found

    def packets(self) -> list[tuple[int, ...]]:
        """(layer, tick, since) of those that it gets now."""
        return [one[:3] for one in self.messages() if isinstance(one, tuple)]

    def tiles(self) -> dict[int, int]:
        """Number of tiles of each layer that it gets now."""
        return {one[0]: one[3] for one in self.messages() if isinstance(one, tuple)}


def test_a_fog_is_sent_with_its_tick_and_only_once_it_is_known(quiet: Seen, monkeypatch: pytest.MonkeyPatch) -> None:
    known, last_seen = False, PastBeliefs.last_seen
    monkeypatch.setattr(PastBeliefs, "last_seen", lambda one, number, k: last_seen(one, number, k) if known else None)
    player = Player(quiet.open())
    hub = Hub(player)
    with closing(Page(hub)) as page:
        assert page.packets() == [(0, 0, 0)]
        hub.select(page.viewer, [1])
        assert page.packets() == []
        known = True
        assert page.packets() == [(1, 0, 0)]
        assert page.packets() == []
        known = False
        player.control({"do": "seek", "k": 40})
        assert page.messages()[-1]["type"] == "state"
        assert page.packets() == []
        known = True
        assert page.packets() == [(1, 40, 0)]


def test_a_fog_that_no_page_shows_is_not_kept_and_comes_again_as_a_whole(quiet: Seen) -> None:
    hub = Hub(Player(quiet.open()))
    with closing(Page(hub)) as page, closing(Page(hub)) as other:
        whole = page.tiles()
        assert other.tiles() == whole
        hub.select(page.viewer, [-7])
        assert page.tiles() == {}
        hub.select(page.viewer, [0])
        assert page.tiles() == {}  # the other one shows it all the time
        for one in (page, other):
            hub.select(one.viewer, [-7])
        assert page.tiles() == {}
        hub.select(page.viewer, [0])
        assert page.tiles() == whole


def test_what_a_page_in_the_background_shows_is_followed_too(quiet: Seen, monkeypatch: pytest.MonkeyPatch) -> None:
    wire = FakeFeed(quiet)
    monkeypatch.setattr("monitor.live.feed_source.REMEMBERED", sum(len(record) for record in wire.records[-8:]))
    hub = Hub(wire.source())
    with closing(Page(hub)) as page:
        hub.select(page.viewer, [3])
        wire.send(4)
        for _ in range(2):
            page.messages()
        page.viewer.drawn = False  # it is in the background, where browsers draw nothing
        for _ in range(10):
            wire.send(5)
            wire.now += KEPT_S / 2
            hub.turn()
        page.viewer.drawn = True
        (layer, tick, since) = page.packets()[-1]
        assert (layer, since) == (3, 0)
        assert tick == wire.number - 2  # all but the header
        np.testing.assert_array_equal(hub.source.last_seen(3), quiet.beliefs[tick, 3])
    hub.remove(page.viewer)
    for _ in range(3):
        wire.send(1)
        wire.now += KEPT_S / 2
        hub.turn()
    assert hub.source.last_seen(3) is None  # nobody shows it any more, so it begins anew


def test_of_a_fog_that_stays_the_tick_is_sent(faulty: Seen) -> None:
    player = Player(faulty.open())
    hub = Hub(player)
    told = []
    with closing(Page(hub)) as page:
        hub.select(page.viewer, [1])
        for k in (48, 52):  # the robot is dead
            player.control({"do": "seek", "k": k})
            while (1, k, 0) not in (packets := page.packets()):
                pass
            told += packets
    assert told == [(1, 48, 0), (1, 52, 0)]


def test_a_page_gets_no_more_of_a_long_chart_than_it_can_show(quiet: Seen, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("monitor.page.hub.MOST_POINTS", 10)
    with closing(Page(Hub(Player(quiet.open())))) as page:
        told = next(one for one in page.messages() if isinstance(one, dict) and one["type"] == "series")
    assert 4 <= len(told["k"]) <= 11
    assert (told["k"][0], told["k"][-1]) == (0, 79)


def test_a_chart_of_any_length_keeps_its_ends_and_its_stalest_ticks() -> None:
    ticks = np.arange(1_000_003)
    mfow = np.random.default_rng(3).uniform(0.0, 50.0, ticks.size)
    mfow[[123_456, 777_777]] = 200.0, np.nan
    few = thinned(Series(ticks, mfow, mfow / 2.0), MOST_POINTS)
    assert MOST_POINTS / 4 < few.ticks.size <= MOST_POINTS + 1
    assert {0, 123_456, 1_000_002} <= set(few.ticks.tolist())
    assert (np.diff(few.ticks) > 0).all()
    np.testing.assert_array_equal(few.mfow_s, mfow[few.ticks])
    np.testing.assert_array_equal(few.fog_mean_s, mfow[few.ticks] / 2.0)
    short = Series(ticks[:5], mfow[:5], mfow[:5])
    assert thinned(short, 5) is short


def test_the_points_of_closures_are_told_run_by_run(doors: Seen) -> None:
    run = doors.open()
    marks = json.loads(static_message(Player(run).static(), may_control=False))["marks"]
    told = {mark["name"]: mark["runs"] for mark in marks if mark["section"] == "closures"}
    for closure in run.prepared.scenario.closures:
        points = [at for first, count in told[closure.name] for at in range(first, first + count)]
        assert points == closure_points(closure, run.prepared.terrain).tolist()
        assert all(first // 100 == (first + count - 1) // 100 for first, count in told[closure.name])
