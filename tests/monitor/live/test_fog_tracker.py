"""Robots' beliefs by the feed of their world: from when on they are known, and how long they are followed."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from monitor.live.fog_tracker import HEARD, KEPT_S, FogTracker, FogTrackers
from monitor.observation.source import OUTSIDE, Layer
from monitor.replay.player import Player
from patrol.ground.fog import NEVER
from tests.monitor.conftest import Seen
from tests.monitor.live.test_feed_source import FakeFeed, played, watched
from tests.monitor.replay.test_player import believed_of
from tests.present import present


def test_of_a_belief_it_is_told_from_when_on_it_is_known(faulty: Seen) -> None:
    wire = FakeFeed(faulty)
    wire.number = 20
    source = wire.source()
    first = watched(source).k + 1
    for layer in (HEARD, 3):
        assert (present(source.last_seen(layer)).max(), source.since(layer)) == (NEVER, first)
    assert source.since("truth") == 0
    wire.send(20)
    believed = faulty.beliefs[watched(source).k, 3]
    seen = present(source.last_seen(3))
    known = seen >= source.since(3)
    assert known.any()
    assert not known.all()
    np.testing.assert_array_equal(seen[known], believed[known])


def test_who_comes_back_to_life_knows_nothing_and_that_is_known(faulty: Seen) -> None:
    wire = FakeFeed(faulty)
    wire.number = 40
    source = wire.source()
    watched(source)
    source.last_seen(1)
    wire.send(10_000)
    state = watched(source)
    assert source.since(1) == 0
    np.testing.assert_array_equal(source.last_seen(1), faulty.beliefs[state.k, 1])


@pytest.mark.parametrize("asked", ["before", "after"])
def test_a_belief_begins_with_what_is_remembered(faulty: Seen, monkeypatch: pytest.MonkeyPatch, asked: str) -> None:
    wire = FakeFeed(faulty)
    monkeypatch.setattr("monitor.live.feed_source.REMEMBERED", sum(len(record) for record in wire.records[-30:]))
    source = wire.source()
    if asked == "before":
        source.last_seen(3)
    wire.send(10_000)
    state = watched(source)
    source.last_seen(3)
    source.wait(0.0)
    seen, since = present(source.last_seen(3)), source.since(3)
    assert state.k - 40 < since < state.k
    known = seen >= since
    np.testing.assert_array_equal(seen[known], faulty.beliefs[state.k, 3][known])


def test_points_that_do_not_count_for_a_robot_say_so(mixed: Seen) -> None:
    run, (source, _) = mixed.open(), played(mixed)
    player = Player(run)
    for layer in run.numbers:
        source.last_seen(layer)
    source.wait(0.0)
    outside = {layer: run.prepared.patrolled & ~run.prepared.fields[layer].patrolled for layer in run.numbers}
    assert any(points.any() for points in outside.values())
    assert player.wait(1.0) is not None
    for layer in run.numbers:
        np.testing.assert_array_equal(source.last_seen(layer) == OUTSIDE, outside[layer])
        np.testing.assert_array_equal(believed_of(player, layer) == OUTSIDE, outside[layer])


def test_a_belief_that_nobody_looks_at_any_more_costs_nothing(quiet: Seen, monkeypatch: pytest.MonkeyPatch) -> None:
    taken: list[FogTracker] = []
    step = FogTracker.step

    def counted(tracker: FogTracker) -> None:
        taken.append(tracker)
        step(tracker)

    monkeypatch.setattr(FogTracker, "step", counted)
    wire = FakeFeed(quiet)
    source = wire.source()
    source.last_seen(1)
    for _ in range(4):
        wire.now += KEPT_S / 2
        source.last_seen(2)
        wire.send(5)
        watched(source)
    assert len(taken) == 20 + 10  # robot 1's are taken in until nobody has asked for it for long enough
    assert source.last_seen(2) is not None
    assert source.last_seen(1) is None  # it begins anew
    source.wait(0.0)
    np.testing.assert_array_equal(source.last_seen(1), quiet.beliefs[19, 1])


def test_a_belief_that_lags_a_little_is_shown_as_of_its_tick(quiet: Seen, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("monitor.live.feed_source.SLICE_S", 0.0)  # one tick a turn, however many there are
    wire = FakeFeed(quiet)
    source = wire.source()
    source.last_seen(2)
    lags = []
    for ticks in (1, 1, 3, 9, 9, 9, *[0] * 10):
        wire.send(ticks)
        source.wait(0.0)
        seen, tick = source.last_seen(2), source.tick(2)
        lags.append(source.tick("truth") - tick)
        assert (seen is None) == (lags[-1] > source.static().late)
        if seen is not None:
            np.testing.assert_array_equal(seen, quiet.beliefs[tick, 2])
    assert lags[:6] == [0, 0, 2, 10, 18, 26]
    assert lags[6:] == list(range(25, 15, -1))


def test_however_many_are_behind_each_is_served_in_turn(quiet: Seen, monkeypatch: pytest.MonkeyPatch) -> None:
    wire = FakeFeed(quiet)
    makers: list[Callable[[Layer], FogTracker]] = []
    made: dict[Layer, FogTracker] = {}

    def noted(make: Callable[[Layer], FogTracker]) -> FogTrackers:
        makers.append(make)
        return FogTrackers(make)

    monkeypatch.setattr("monitor.live.feed_source.FogTrackers", noted)
    source = wire.source()
    trackers = FogTrackers(lambda layer: made.setdefault(layer, makers[0](layer)))
    for layer in (1, 2, 3):
        trackers.track(layer, 0.0)
    served = []
    for _ in range(6):  # each time there is more to take in for each of them than can be taken in
        wire.send(10)
        watched(source)
        before = {layer: int(tracker.fog.last_seen.max()) for layer, tracker in made.items()}
        trackers.catch_up(partial(next, iter([False] * 4 + [True])))
        served += [layer for layer, tracker in made.items() if tracker.fog.last_seen.max() > before[layer]]
    assert served == [1, 2, 3, 1, 2, 3]
    trackers.catch_up(lambda: False)
    assert not trackers.behind
