"""Intruder games against what counting by hand, and a plain loop, give."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from experiments.intruders.standing import Successes, attack_ticks, best_wait, intruder_games, unseen_times
from tests.present import present


def seen_at(ticks: int, *places: list[int]) -> NDArray[np.bool_]:
    seen = np.zeros((ticks, len(places)), dtype=np.bool_)
    for place, when in enumerate(places):
        seen[when, place] = True
    return seen


def plain_random(seen: NDArray[np.bool_], ticks: int) -> list[bool]:
    ends = range(len(seen) - ticks)
    return [not seen[t + 1 : t + ticks + 1, place].any() for place in range(seen.shape[1]) for t in ends]


def plain_waiting(seen: NDArray[np.bool_], ticks: int) -> list[float]:
    shares = []
    for place in range(seen.shape[1]):
        own = [
            not seen[t + 1 : t + ticks + 1, place].any()
            for t in range(len(seen) - ticks)
            if seen[t, place] and not seen[t + 1, place]
        ]
        if own:
            shares.append(float(np.mean(own)))
    return shares


@given(seed=st.integers(0, 2**32 - 1), ticks=st.integers(1, 12))
def test_random_and_waiting_are_those_of_a_plain_loop(seed: int, ticks: int) -> None:
    dice = np.random.default_rng(seed)
    seen = dice.random((int(dice.integers(13, 60)), 3)) < dice.choice([0.05, 0.2, 0.6])
    (found,) = intruder_games(seen, 0.5, [0.5 * ticks])
    assert found.random == pytest.approx(np.mean(plain_random(seen, ticks)))
    waiting = plain_waiting(seen, ticks)
    assert found.waiting == (pytest.approx(np.mean(waiting)) if waiting else None)


def test_a_place_that_is_seen_every_ten_ticks() -> None:
    seen = seen_at(101, list(range(0, 101, 10)))
    short, exact, long = intruder_games(seen, 1.0, [5.0, 9.0, 10.0])
    # Of the 96 ticks in which an attack of five can begin, those succeed that come 0 to 4 after the robot: 50.
    assert short.random == pytest.approx(50 / 96)
    assert short.waiting == short.statistical == 1.0
    assert exact.waiting == exact.statistical == 1.0
    assert exact.random == pytest.approx(10 / 92)
    assert long == Successes(10.0, 0.0, 0.0, 0.0)
    assert (short.worst, long.worst) == (1.0, 0.0)


def test_the_statistical_intruder_waits_for_the_long_times() -> None:
    """A place is unseen for 2 ticks, again and again, and now and then for 30: after 3 ticks a long time has begun."""
    begins = np.cumsum([0, *([3] * 9 + [31]) * 12])
    seen = seen_at(int(begins[-1]) + 1, begins.tolist())
    assert best_wait(unseen_times(seen[:, 0]), 20) == 3
    (found,) = intruder_games(seen, 1.0, [20.0])
    assert found.statistical == 1.0
    assert present(found.waiting) < 0.2


def test_a_few_lucky_times_do_not_outweigh_many() -> None:
    """An attack of ten ticks after 3 ticks succeeds in 95 of 105 cases, after 21 in 5 of 5."""
    assert best_wait(np.repeat([2, 12, 20, 60], [50, 10, 90, 5]), 10) == 3


def test_a_place_that_is_always_seen_is_never_attacked_by_those_who_wait() -> None:
    (found,) = intruder_games(np.ones((50, 2), dtype=np.bool_), 1.0, [5.0])
    assert found == Successes(5.0, 0.0, None, None)
    assert found.worst == 0.0


def test_a_run_shorter_than_the_attack_has_none() -> None:
    assert intruder_games(np.zeros((5, 2), dtype=np.bool_), 1.0, [60.0]) == [Successes(60.0, None, None, None)]


def test_an_attack_is_not_cut_short_to_whole_ticks() -> None:
    """1.25 s are three ticks of half a second: a place that is unseen for two of them does not suffice."""
    seen = seen_at(101, list(range(0, 101, 3)))
    (found,) = intruder_games(seen, 0.5, [1.25])
    assert found == Successes(1.25, 0.0, 0.0, 0.0)
    assert [attack_ticks(attack_s, step) for attack_s, step in ((0.3, 0.1), (25.0, 0.5), (0.1, 1.0))] == [3, 50, 1]


def test_the_statistical_intruder_knows_the_first_half_alone() -> None:
    """A place is unseen for 9 ticks each time in the first half, and for 2 and 12 in turn in the second.

    By the first half, an attack of five ticks is best at once, which fails in every other time of the second. Whoever
    knew the second half would wait for three ticks, and never fail.
    """
    begins = np.cumsum([0, *[10] * 16, *[3, 13] * 10])
    seen = seen_at(int(begins[-1]) + 1, begins.tolist())
    (found,) = intruder_games(seen, 1.0, [5.0])
    assert found.statistical == 0.5


def test_an_attack_at_once_begins_in_the_last_tick_that_is_seen() -> None:
    """A place is seen for 3 ticks and unseen for 5; an attack of 5 in an earlier one of the 3 would fail."""
    seen = np.arange(400)[:, None] % 8 < 3
    (found,) = intruder_games(seen, 1.0, [5.0])
    assert found.statistical == 1.0


@pytest.mark.parametrize(("times", "won"), [(5, 1.0), (4, 0.5)])
def test_a_place_that_was_unseen_five_times_is_judged_by_those(times: int, won: float) -> None:
    """For an attack of 8 ticks 9 unseen ones say: at once. Those of both places say: after 10, when 2 are left here."""
    seen = np.ones((861, 2), dtype=np.bool_)
    begins = np.cumsum([0, *[10] * times])
    seen[: begins[-1], 0] = False
    seen[begins, 0] = True
    seen[430:, 0] = np.arange(431) % 13 == 0
    seen[:, 1] = False
    seen[np.cumsum([0, *([3] * 4 + [31]) * 20]), 1] = True
    assert [best_wait(unseen_times(seen[:430, place]), 8) for place in (0, 1)] == [0, 3]
    (found,) = intruder_games(seen, 1.0, [8.0])
    assert found.statistical == won
