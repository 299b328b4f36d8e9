"""The learned intruder on made-up patrols, for which the best success is known."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.intruders import learned
from experiments.intruders.learned import Learned, Trials, Watched, first_attack, learned_games
from experiments.intruders.standing import Seen
from patrol.errors import BadInput
from tests.present import present

# Not the product's own, so that a wrong one there is noticed.
WINDOW = 10


def blind(seen: Seen, step: float = 1.0) -> Watched:
    """A patrol whose robots are not to be seen."""
    return Watched(seen, np.zeros(seen.shape, np.float32), np.zeros(seen.shape, np.float32), step)


def round_trip(ticks: int) -> Watched:
    """One robot on a ring of twelve places, 6 m apart, at 1 m/s: each is seen every 72 s."""
    places = 6.0 * np.arange(12)
    off = (np.arange(ticks)[:, None] - places + 36.0) % 72.0 - 36.0
    pixels = np.maximum(np.abs(off) / 0.075, 1.0)
    towards = np.zeros(off.shape)
    towards[1:] = pixels[:-1] - pixels[1:]
    return Watched(off == 0.0, (1.0 / pixels).astype(np.float32), (towards / pixels).astype(np.float32), 1.0)


def test_of_a_periodic_patrol_it_learns_where_nobody_comes() -> None:
    """An attack of 30 s at any place and time succeeds in 42 / 72 of all cases; a good choice always does."""
    (found,) = learned_games(round_trip(1500), [30.0], Trials((600.0,), 10))
    assert found.attacked == 1.0
    assert found.success is not None
    assert found.success >= 0.9


@pytest.mark.parametrize("chance", [0.01, 0.03])
def test_of_a_patrol_without_memory_it_gets_what_anybody_gets(chance: float) -> None:
    """Each place is seen in each second with the same probability: an attack of 30 s succeeds with (1 - p)^30."""
    seen = np.random.default_rng(1).random((6000, 6)) < chance
    (found,) = learned_games(blind(seen), [30.0], Trials((100.0,), 60))
    possible = (1.0 - chance) ** 30
    assert present(found.success) <= possible + 3.0 * np.sqrt(possible * (1.0 - possible) / 60)


def test_a_place_that_nobody_comes_to_is_attacked_with_success() -> None:
    seen = np.ones((400, 3), dtype=np.bool_)
    seen[:, 1] = False
    assert learned_games(blind(seen), [20.0], Trials((300.0,), 4)) == [Learned(300.0, 20.0, 1.0, 1.0)]


def test_a_trial_without_an_attack_is_a_failure() -> None:
    """Places that are always seen: after some training no output says that an attack would succeed."""
    seen = np.ones((500, 3), dtype=np.bool_)
    assert learned_games(blind(seen), [5.0], Trials((500.0,), 3)) == [Learned(500.0, 5.0, 0.0, 0.0)]


def test_an_attack_is_over_within_the_horizon_and_the_run() -> None:
    """Of a run as long as the horizon: one of 59 s can begin at tick 60 alone, and covers the ticks 61 to 119."""
    seen = np.zeros((120, 2), dtype=np.bool_)
    trials = Trials((120.0,), 10)
    unseen, longer = learned_games(blind(seen), [59.0, 60.0], trials)
    assert unseen.success == unseen.attacked
    assert (longer.success, longer.attacked) == (None, None)
    seen[119] = True
    (seen_last,) = learned_games(blind(seen), [59.0], trials)
    assert (seen_last.success, seen_last.attacked) == (0.0, unseen.attacked)
    assert present(unseen.attacked) > 0.0


def test_two_ticks_a_second_are_played_every_second_tick() -> None:
    """The same patrol in ticks of half a second, between whose seconds nothing happens, gives the same trials."""
    slow = np.random.default_rng(2).random((400, 4)) < 0.02
    fast = np.repeat(slow, 2, axis=0)
    fast[1::2] = False
    trials = Trials((200.0,), 2)
    (seconds,) = learned_games(blind(slow), [9.0], trials)
    (halves,) = learned_games(blind(fast, 0.5), [9.0], trials)
    assert seconds == halves


def test_it_is_the_same_again_and_reports_its_progress() -> None:
    watched = round_trip(300)
    shares: list[float] = []
    trials = Trials((60.0, 80.0), 3)
    found = learned_games(watched, [10.0, 20.0], trials, shares.append)
    assert learned_games(watched, [10.0, 20.0], trials) == found
    assert [(each.horizon_s, each.attack_s) for each in found] == [(60, 10), (60, 20), (80, 10), (80, 20)]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_a_run_shorter_than_a_horizon_is_refused() -> None:
    with pytest.raises(BadInput, match=r"^horizon of 300 s: the run has only 200 s; choose a shorter horizon or make"):
        learned_games(blind(np.zeros((400, 2), dtype=np.bool_), 0.5), [5.0], Trials((150.0, 300.0), 3))


@given(st.lists(st.sampled_from([0.0, 0.2, 0.499, 0.5, 0.9]), min_size=WINDOW + 1, max_size=60), st.integers(-5, 50))
def test_it_attacks_at_the_first_chance_for_which_it_is_armed(outputs: list[float], in_time: int) -> None:
    seconds = len(outputs)
    outputs[: WINDOW - 1] = [0.0] * (WINDOW - 1)
    times = [seconds / 2 <= second < seconds - 3 for second in range(seconds)]
    expected = -1
    for second in range(WINDOW - 1, seconds):
        past = outputs[WINDOW - 1 : second + 1]
        share = sum(output >= 0.5 for output in past) / len(past)
        left = in_time - second
        armed = left <= 0 or 1.0 - (1.0 - share) ** left < 0.999
        if outputs[second] >= 0.5 and armed and times[second]:
            expected = second
            break
    remaining = in_time - np.arange(seconds, dtype=np.float64)
    found = first_attack(np.array([outputs], dtype=np.float32), np.array(times), remaining)
    assert found.tolist() == [expected]


class Watching:
    """Networks that note what they are trained on, and expect nothing until a second that a test sets."""

    trained: ClassVar[list[tuple[np.ndarray, np.ndarray, np.ndarray]]] = []
    outcomes: ClassVar[list[float]] = []

    def __init__(self, weights: object) -> None:
        del weights
        type(self).trained = []

    def train(self, windows: np.ndarray, unseen: np.ndarray, weight: np.ndarray) -> None:
        self.trained.append((windows.copy(), unseen.copy(), weight.copy()))

    def outputs(self, windows: np.ndarray) -> np.ndarray:
        likely = np.zeros((windows.shape[0], 1, windows.shape[-1]), dtype=np.float32)
        likely[:, :, 1] = self.outcomes.pop(0) if self.outcomes else 0.0
        return likely


def test_each_second_it_is_trained_on_four_windows_whose_attack_is_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """Attacks of 5 s, and windows of 10 s: the first is known at second 14, whose labels are those of second 9."""
    monkeypatch.setattr(learned, "Networks", Watching)
    seen = np.random.default_rng(4).random((60, 3)) < 0.15
    learned_games(blind(seen), [5.0], Trials((60.0,), 1))
    assert len(Watching.trained) == 60 - 14
    succeeds = np.array([[not seen[t + 1 : t + 6, place].any() for place in range(3)] for t in range(55)])
    for second, (windows, labels, weight) in enumerate(Watching.trained, start=14):
        assert windows.shape == (1, 3, WINDOW, 4, 3)
        known = succeeds[9 : second - 4]
        # Of the odds against an attack, a quarter of what they are above 1.
        odds = (known.size - known.sum()) / max(known.sum(), 1)
        assert weight[0] == pytest.approx(0.25 * odds + 0.75)
        for place_in_batch in range(4):
            assert any((labels[0, place_in_batch] == one).all() for one in known)
    assert Watching.trained[0][1][0].tolist() == [succeeds[9].tolist()] * 4


@pytest.mark.parametrize("step", [1.0, 0.5])
def test_a_window_shows_the_last_ten_seconds(step: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """A place that was never seen is idle since the watch began; idleness counts in attacks, of 5 s."""
    monkeypatch.setattr(learned, "Networks", Watching)
    ticks = round(60 / step)
    near = np.arange(ticks * 2, dtype=np.float32).reshape(ticks, 2)
    watched = Watched(np.zeros((ticks, 2), dtype=np.bool_), near, -near, step)
    learned_games(watched, [5.0], Trials((60.0,), 1))
    first = Watching.trained[0][0][0, :, :, 0, :]
    stride = round(1.0 / step)
    assert first[0, :, 0] == pytest.approx(np.arange(10) / 5.0)
    assert first[1] == pytest.approx(near[: 10 * stride : stride])
    assert first[2] == pytest.approx(-near[: 10 * stride : stride])


@pytest.mark.parametrize(("begun", "attacked"), [(38, 0.0), (39, 0.0), (50, 1.0), (54, 1.0), (55, 0.0)])
def test_it_attacks_in_the_second_half_while_an_attack_is_over_in_time(
    begun: int, attacked: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of 80 s; attacks take 25 s, and ticks 40 to 54 are the first and the last. Chances before make it wait.

    In 0.9 * 80 - 25 = 47 s it wants to be done, so from second 47 on it takes any chance.
    """
    monkeypatch.setattr(learned, "Networks", Watching)
    monkeypatch.setattr(Watching, "outcomes", [0.0] * (begun - 9) + [1.0])
    (found,) = learned_games(blind(np.zeros((80, 3), dtype=np.bool_)), [25.0], Trials((80.0,), 1))
    assert found.attacked == attacked


def test_where_there_is_always_a_chance_it_waits_until_nine_tenths_of_the_horizon(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Another chance is sure until second 0.9 * 80 - 25 = 47; the place is unseen from tick 48 to tick 72 alone."""
    monkeypatch.setattr(learned, "Networks", Watching)
    monkeypatch.setattr(Watching, "outcomes", [1.0] * 80)
    seen = np.ones((80, 3), dtype=np.bool_)
    seen[48:73, 1] = False
    assert learned_games(blind(seen), [25.0], Trials((80.0,), 1)) == [Learned(80.0, 25.0, 1.0, 1.0)]
