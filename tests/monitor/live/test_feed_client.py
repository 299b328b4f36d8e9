"""A viewer's knowledge of its world, from the world's own messages."""

from typing import Any, cast

import pytest

from monitor.live.feed_client import WAITS_S, FeedClient
from runtime.messages.feed import TICKS, Batch, batch_bytes
from runtime.messages.telemetry import EVENTS, WAITS, Notice, pack_view
from runtime.net.mailbox import Presence
from runtime.security.keys import WORLD, fleet_keys
from tests.monitor.live.test_positions_source import Ears

KEYS = fleet_keys("fleet-1")


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    clock = [1000.0]
    monkeypatch.setattr("monitor.live.feed_client.time.monotonic", lambda: clock[0])
    return clock


class World:
    """The world's end of a feed."""

    def __init__(self) -> None:
        self._ears = Ears()
        self.client = FeedClient(cast(Any, self._ears), KEYS, "token")

    def notify(self, kind: str, detail: str) -> None:
        self._deliver(KEYS.truth(EVENTS), pack_view(Notice(3, kind, "", detail)))

    def send(self, first: int, *records: bytes) -> None:
        self._deliver(KEYS.truth(TICKS), batch_bytes(Batch(first, records, running=True, pace=None)))

    def appear(self, present: bool) -> None:
        self._ears.subscribed[KEYS.alive(WORLD)].put(KEYS.alive(WORLD), Presence(present))

    def _deliver(self, key: str, payload: bytes) -> None:
        self._ears.subscribed[key].deliver(key, payload)


def test_a_batch_comes_once_and_whether_the_world_is_there_is_no_batch(now: list[float]) -> None:
    world = World()
    assert not world.client.present
    assert world.client.may_control
    assert world.client.batch(0.0) is None
    world.appear(True)
    world.send(4, b"one", b"two")
    world.appear(False)
    found = world.client.batch(0.0)
    assert found is not None
    assert (found.first, found.records, world.client.present) == (4, (b"one", b"two"), True)
    assert world.client.batch(0.0) is None
    assert not world.client.present
    assert not FeedClient(cast(Any, Ears()), KEYS).may_control
    assert now == [1000.0]


def test_the_world_waits_as_long_as_it_says_so_or_until_ticks_come(now: list[float]) -> None:
    world = World()
    assert world.client.waits == ""
    world.notify("dead", "f1 kill")
    assert world.client.waits == ""
    world.notify(WAITS, "r1, r2")
    assert world.client.waits == f"{WAITS} r1, r2"
    now[0] += WAITS_S - 0.01
    assert world.client.waits == f"{WAITS} r1, r2"
    now[0] += 0.01
    assert world.client.waits == ""
    world.notify(WAITS, "r2")
    assert world.client.waits == f"{WAITS} r2"
    world.send(5)  # only that it runs
    assert world.client.batch(0.0) is not None
    assert world.client.waits == f"{WAITS} r2"
    world.send(5, b"tick")
    assert world.client.batch(0.0) is not None
    assert world.client.waits == ""
