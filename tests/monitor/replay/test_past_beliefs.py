"""Robots' beliefs that a replay keeps, and for how long."""

from collections.abc import Callable
from itertools import count

import numpy as np
import pytest

from monitor.replay.fog_history import FogHistory, Snapshot
from monitor.replay.past_beliefs import BUDGET_S, MOST, PastBeliefs
from patrol.ground.fog import Fog
from tests.monitor.conftest import Seen

COME_AND_GONE = (*range(0, 80, 7), *range(79, 0, -9))


@pytest.mark.parametrize("memory", [0, 2000, 1 << 20])
def test_snapshots_stay_within_their_memory_and_are_right(
    faulty: Seen, monkeypatch: pytest.MonkeyPatch, memory: int
) -> None:
    run = faulty.open()
    histories: list[FogHistory] = []

    def noted(blank: Callable[[], Fog], advance: Callable[[Fog, int], Fog], ticks: int, given: int) -> FogHistory:
        assert given == memory
        histories.append(FogHistory(blank, advance, ticks, given))
        return histories[-1]

    monkeypatch.setattr("monitor.replay.past_beliefs.MEMORY", memory * MOST)
    monkeypatch.setattr("monitor.replay.past_beliefs.FogHistory", noted)
    past = PastBeliefs(run, None, lambda: 0.0)
    one = Snapshot.of(next(iter(faulty.truth.values()))).nbytes
    for _ in range(2):
        for number in run.numbers:
            for k in COME_AND_GONE:
                if (k, number) in faulty.beliefs:
                    np.testing.assert_array_equal(past.last_seen(number, k), faulty.beliefs[k, number])
            assert all(history.held <= memory + one for history in histories)
    assert len(histories) == len(run.numbers)


def test_all_robots_that_pages_show_are_found_out_in_little_room(faulty: Seen, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each in the other's place would be begun anew for ever."""
    monkeypatch.setattr("monitor.replay.past_beliefs.MEMORY", 1)
    asked = count()
    past = PastBeliefs(faulty.open(), None, lambda: next(asked) * BUDGET_S / 8)  # little is done at once
    past.set_shown([1, 2, 3])
    found = {number for _ in range(400) for number in (1, 2, 3) if past.last_seen(number, 47) is not None}
    assert found == {1, 2, 3}
    monkeypatch.setattr("monitor.replay.past_beliefs.MOST", 2)
    past = PastBeliefs(faulty.open(), None, lambda: 0.0)
    past.set_shown([1, 2, 3])
    assert [past.last_seen(number, 3) is None for number in (1, 2, 3)] == [False, False, True]
    past.set_shown([2, 3])
    assert past.last_seen(3, 3) is not None


def test_a_snapshot_is_the_map_again() -> None:
    random = np.random.default_rng(5)
    for shape in ((1, 1), (7, 5), (64, 130)):
        seen = random.integers(-2, 3, shape, dtype=np.int32)
        runs = Snapshot.of(seen)
        np.testing.assert_array_equal(runs.map(), seen)
        assert runs.map().dtype == np.int32
    assert Snapshot.of(np.full((100, 100), 7, dtype=np.int32)).nbytes == 8
