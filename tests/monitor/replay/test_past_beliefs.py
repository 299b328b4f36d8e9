"""What a replay keeps of robots' beliefs, and for how long."""

from __future__ import annotations

import tracemalloc
from itertools import count
from typing import TYPE_CHECKING

import numpy as np
import pytest

from monitor.replay.past_beliefs import BUDGET_S, KEPT_S, PastBeliefs
from monitor.replay.snapshot import Snapshot

if TYPE_CHECKING:
    from tests.monitor.conftest import Seen

COME_AND_GONE = (*range(0, 80, 7), *range(79, 0, -9))


class Clock:
    """Wall time that stands still unless it is told otherwise."""

    def __init__(self) -> None:
        self.time_s = 0.0

    def __call__(self) -> float:
        return self.time_s


def looked(past: PastBeliefs, seen: Seen, number: int) -> None:
    """Look at a robot all over the run, forwards and backwards."""
    for k in COME_AND_GONE:
        if (k, number) in seen.beliefs:
            np.testing.assert_array_equal(past.last_seen(number, k), seen.beliefs[k, number])


@pytest.mark.parametrize("maps", [1, 3, 6, 1000])
def test_what_it_keeps_stays_within_its_memory_however_many_are_looked_at(
    faulty: Seen, monkeypatch: pytest.MonkeyPatch, maps: int
) -> None:
    run = faulty.open()
    size = next(iter(faulty.truth.values())).nbytes
    memory = maps * size + 40_000  # what a robot's looks take
    monkeypatch.setattr("monitor.replay.past_beliefs.MEMORY", memory)
    past = PastBeliefs(run, None, Clock())
    for _ in range(2):
        for number in run.numbers:
            looked(past, faulty, number)
            assert 0 < past.held <= memory


def test_robots_that_pages_show_are_found_out_all_of_them_however_little_room_there_is(
    faulty: Seen, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each in the other's place would be begun anew for ever."""
    monkeypatch.setattr("monitor.replay.past_beliefs.MEMORY", 1)
    clock = Clock()
    asked = count()
    past = PastBeliefs(faulty.open(), None, lambda: next(asked) * BUDGET_S / 8)  # little is done at once
    past.set_shown([1, 2, 3])
    found: dict[int, int] = {}
    for turn in range(400):
        for number in (1, 2, 3):
            if number not in found and past.last_seen(number, 47) is not None:
                found[number] = turn
    assert set(found) == {1, 2, 3}
    monkeypatch.setattr("monitor.replay.past_beliefs.MOST", 2)
    past = PastBeliefs(faulty.open(), None, clock)
    past.set_shown([1, 2, 3])
    assert [past.last_seen(number, 3) is None for number in (1, 2, 3)] == [False, False, True]
    past.set_shown([2, 3])
    assert past.last_seen(3, 3) is not None


def test_what_it_says_that_it_keeps_is_what_it_keeps(faulty: Seen) -> None:
    run = faulty.open()
    looked(PastBeliefs(run, None, Clock()), faulty, 2)  # whatever is made once
    past = PastBeliefs(run, None, Clock())
    tracemalloc.start()
    try:
        for number in run.numbers:
            looked(past, faulty, number)
        kept, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert past.held > kept / 3


def test_a_robot_that_no_page_shows_is_kept_for_a_while_only(quiet: Seen) -> None:
    clock = Clock()
    past = PastBeliefs(quiet.open(), None, clock)
    for number in (1, 2):
        looked(past, quiet, number)
    both = past.held
    clock.time_s += KEPT_S
    past.set_shown([2])
    assert past.held == both
    clock.time_s += 1.0
    past.set_shown([2, 3])
    assert 0 < past.held < both
    clock.time_s += KEPT_S + 1.0
    past.set_shown([])
    assert past.held == 0
    looked(past, quiet, 1)


def test_a_snapshot_is_the_map_again() -> None:
    random = np.random.default_rng(5)
    for shape in ((1, 1), (7, 5), (64, 130)):
        seen = random.integers(-2, 3, shape, dtype=np.int32)
        runs = Snapshot.of(seen)
        np.testing.assert_array_equal(runs.map(), seen)
        assert runs.map().dtype == np.int32
    assert Snapshot.of(np.full((100, 100), 7, dtype=np.int32)).nbytes == 8
