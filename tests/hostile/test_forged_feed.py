"""A stranger at an open router who sends what a world sends to viewers: they see the world's run all the same."""

import threading
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import msgpack
import numpy as np
import pytest

from monitor.live.attach import open_fleet
from monitor.observation.source import Source, State
from patrol.journal import pack, unpack
from patrol.journal.records import End
from runtime.messages.feed import FOG, MAX_BATCH, TICKS, Batch, batch_bytes, so_far_bytes
from runtime.net.link import Link, open_link
from runtime.net.mailbox import Mailbox, Question
from runtime.process.lifeline import Ending
from runtime.security.keys import WORLD, FleetKeys
from tests.monitor.conftest import Seen, quiet
from tests.monitor.live.test_feed_source import FakeFeed
from tests.routers import PATIENCE_S

__all__ = ["quiet"]

FLEET = "watched-1"
WAITS = 3000
"""Waits of a tenth of a second."""


def unread(_payload: bytes) -> Question:
    raise ValueError("questions are put in as they are")


class Feeding:
    """A world that is over, as far as a viewer can see it: its token, its answers, and batches when it is told to."""

    def __init__(self, router: str, seen: Seen) -> None:
        keys = FleetKeys(FLEET)
        self.told = FakeFeed(seen)
        self.link = open_link(router, PATIENCE_S)
        self._post = self.link.post(keys.truth(TICKS))
        self._questions: Mailbox[Question] = Mailbox([keys.truth(FOG)], unread, 0)
        self._over = threading.Event()
        self.link.attend(keys.truth(FOG), 0, self._questions)
        self.link.live(keys.alive(WORLD))
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def send(self, records: int) -> None:
        self.told.send(records)
        self._post(batch_bytes(self.told.batches.pop()))

    def _serve(self) -> None:
        while not self._over.is_set():
            if (arrived := self._questions.get(0.05)) is not None:
                (payload,) = self.told.so_far()
                arrived[1].answer(payload)

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        assert self.link.close(PATIENCE_S)


@pytest.fixture
def world(endpoint: str, quiet: Seen) -> Iterator[Feeding]:
    feeding = Feeding(endpoint, quiet)
    yield feeding
    feeding.close()


@pytest.fixture
def stranger(endpoint: str) -> Iterator[Link]:
    link = open_link(endpoint, PATIENCE_S)
    yield link
    assert link.close(PATIENCE_S)


@pytest.fixture
def viewer(endpoint: str, world: Feeding) -> Iterator[Source]:
    assert world.link.connected
    source = open_fleet(Ending(), router=endpoint, fleet=FLEET)
    assert source is not None
    yield source
    source.close()


def until(source: Source, k: int, world: Feeding | None = None) -> State:
    """The state of tick k. The world goes on meanwhile, so that the viewer notices what it has missed."""
    for _ in range(WAITS):
        state = source.wait(0.1)
        if state is not None and state.k >= k:
            return state
        if world is not None and world.told.number < len(world.told.records) - 2:
            world.send(1)
    raise AssertionError("waited in vain")


def test_forged_batches_stop_no_viewer(world: Feeding, stranger: Link, viewer: Source, quiet: Seen) -> None:
    forge = stranger.post(FleetKeys(FLEET).truth(TICKS))
    world.send(5)
    until(viewer, 4)
    tick: Any = unpack(world.told.records[world.told.number])
    row = tick.robots[0]
    number = world.told.number
    for forged in (
        replace(tick, robots=(replace(row, number=99), *tick.robots[1:])),
        replace(tick, robots=(replace(row, x="x"), *tick.robots[1:])),
        replace(tick, k=2**62),
        End("completed", ""),
    ):
        forge(batch_bytes(Batch(number, (pack(forged),), running=True, pace=None)))
    forge(batch_bytes(Batch(0, (), running=True, pace=float("inf"))))
    forge(msgpack.packb([0, [[]], True, None]))
    forge(b"\x94\x00\xdd" + (MAX_BATCH // 2).to_bytes(4, "big") + b"\x80" * (MAX_BATCH // 2) + b"\xc3\xc0")
    last = len(quiet.truth) - 1
    state = until(viewer, last - 2, world)
    assert state.ended is None
    np.testing.assert_array_equal(viewer.last_seen("truth"), quiet.truth[state.k])


def test_a_false_answer_that_claims_to_be_complete_does_not_hide_the_true_one(
    endpoint: str, world: Feeding, stranger: Link, quiet: Seen
) -> None:
    key = FleetKeys(FLEET).truth(FOG)
    forged = so_far_bytes(replace(world.told.answer(), header=b"\xc0"))
    asked = threading.Event()

    def answer(query: Any) -> None:
        asked.set()
        with query:
            query.reply(key, forged)

    held = stranger._session.declare_queryable("fogwatch/**", answer, complete=True)
    other = open_link(endpoint, PATIENCE_S)
    while not asked.is_set():  # the router has heard of the queryable
        list(other.answers(key, b"", MAX_BATCH, PATIENCE_S))
    assert other.close(PATIENCE_S)
    source = open_fleet(Ending(), router=endpoint, fleet=FLEET)
    assert source is not None
    world.send(5)
    state = until(source, 4)
    np.testing.assert_array_equal(source.last_seen("truth"), quiet.truth[state.k])
    source.close()
    held.undeclare()  # type: ignore[no-untyped-call]
