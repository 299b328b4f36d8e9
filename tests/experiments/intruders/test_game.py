"""The infiltration game on patrols with known answers."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from experiments.intruders import game as game_module
from experiments.intruders.game import Game, gain_of, infiltration, share_of
from experiments.intruders.infiltrator import Infiltrator
from patrol.errors import BadInput
from tests.experiments.intruders.made_up import ring, watched

INTRUDER = Infiltrator(within_s=60.0, attempts=30)


def test_one_robot_on_a_ring_lets_every_watcher_in() -> None:
    outcome = infiltration(Game(watched(ring(500.0), 40), INTRUDER), again=True)
    assert outcome.depth_m == 9.5, "half of the deepest"
    for predictor in ("future", "watching"):
        assert outcome.once[predictor].percent == 100.0
    assert outcome.once["blind"].percent < 80.0
    assert outcome.gain.watching.low > 0.0
    assert outcome.again["watching"].percent == 100.0


def test_watching_a_robot_that_jumps_at_random_gains_nothing() -> None:
    places = np.random.default_rng(3).integers(0, 24, (1000, 2, 2)).astype(float)
    watch = watched(places, 24, range_m=2.0)
    outcome = infiltration(Game(watch, Infiltrator(within_s=60.0, attempts=100)))
    assert 10.0 < outcome.once["blind"].percent < 90.0
    assert outcome.gain.watching.low <= 0.0
    assert outcome.once["future"].percent == 100.0
    more = infiltration(Game(watch, Infiltrator(within_s=60.0, attempts=300)))
    assert -15.0 < more.gain.watching.percent < 5.0, "what it learns of chance may mislead it a little"


def test_planning_again_does_not_fall_for_the_best_of_many_forecasts() -> None:
    places = np.random.default_rng(3).integers(0, 24, (1000, 2, 2)).astype(float)
    intruder = Infiltrator(within_s=60.0, attempts=60)
    outcome = infiltration(Game(watched(places, 24, range_m=2.0), intruder), again=True)
    assert outcome.again["watching"].percent >= 0.5 * outcome.once["watching"].percent > 10.0


def test_an_attempt_tells_where_it_went_and_when_it_was_seen() -> None:
    game = Game(watched(ring(500.0), 40), INTRUDER)
    seen = unseen = None
    for now, target in game.trials:
        attempt = game.once(game.predictors["blind"], now, target)
        for tick, point in enumerate(attempt.way.tolist(), start=now + 1):
            in_view = point >= 0 and bool(game.watch.seen(tick, tick + 1)[0, point])
            assert in_view == (tick == attempt.seen)
        assert attempt.succeeded == (attempt.seen is None)
        seen, unseen = seen or attempt.seen, unseen or attempt.succeeded
    assert seen
    assert unseen


def test_a_stay_counts_from_the_end_of_the_tick_in_which_the_intruder_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    game = Game(watched(ring(500.0), 40), INTRUDER)
    blind = game.predictors["blind"]
    attempt = next(won for now, target in game.trials if (won := game.once(blind, now, target)).succeeded)
    came = attempt.way.tolist().index(attempt.target)
    stay = game.planner.stay
    assert len(attempt.way) > came + stay
    for ticks, succeeded in ((stay + 1, True), (stay, False)):
        planner = SimpleNamespace(plan=lambda *_, ticks=ticks: attempt.way[: came + ticks], stay=stay)
        monkeypatch.setattr(game, "planner", planner)
        assert game.once(blind, attempt.now, attempt.target).succeeded == succeeded


def test_a_stay_counts_from_its_whole_time_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """The intruder comes at the end of a tick, and then stays for 10 s of two ticks each."""
    at_first = np.full((1000, 1, 2), math.nan)
    at_first[:10] = 12.0
    game = Game(watched(at_first, 24, range_m=20.0), INTRUDER)
    now, target = game.trials[0]
    planned = game.once(game.predictors["blind"], now, target)
    assert planned.succeeded
    assert planned.way[-21:].tolist() == [target] * 21
    assert planned.way[-22] != target
    for stay, succeeds in ((19, False), (20, False), (21, True), (22, True)):
        way = np.array([-1, target - 1, *[target] * stay, -2], dtype=np.int32)
        monkeypatch.setattr(game.planner, "plan", lambda *_, way=way: way)
        attempt = game.once(game.predictors["blind"], now, target)
        assert (attempt.succeeded, attempt.seen) == (succeeds, None), stay
        broken = np.insert(way, 10, target - 1)
        monkeypatch.setattr(game.planner, "plan", lambda *_, way=broken: way)
        assert not game.once(game.predictors["blind"], now, target).succeeded, "it must not go away meanwhile"


@pytest.mark.parametrize(("sighted", "is_taken"), [(0.29, True), (0.31, False)])
def test_a_way_that_is_planned_again_after_a_second_is_taken_if_much_better(
    sighted: float, is_taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Plans come at ticks 0, 2, 4, ... of half a second; the second way would be seen so often, the old one once."""
    unseen = np.full((1000, 1, 2), math.nan)
    unseen[:10] = 12.0
    game = Game(watched(unseen, 24, range_m=20.0), INTRUDER)
    now, target = game.trials[0]
    ways = [np.full(game.within, point, dtype=np.int32) for point in (target - 1, target - 2)]
    asked: list[tuple[int, int]] = []

    def predictor(tick: int, ahead: int) -> Any:
        asked.append((tick - now, ahead))
        return None

    monkeypatch.setattr(game_module, "sightings", lambda _, way: sighted if way[0] == target - 2 else 1.0)
    monkeypatch.setattr(
        game.planner, "plan", lambda *_: ways[min(len(asked) - 1, 1)][: game.within - 2 * (len(asked) - 1)]
    )
    attempt = game.again(predictor, now, target)
    assert asked == [(tick, game.within - tick) for tick in range(0, game.within, 2)]
    later = target - 2 if is_taken else target - 1
    assert attempt.way.tolist() == [target - 1] * 2 + [later] * (game.within - 2)


def test_the_same_seed_gives_the_same_attempts() -> None:
    watch = watched(ring(500.0), 40)
    assert Game(watch, INTRUDER).trials == Game(watch, INTRUDER).trials
    assert Game(watch, INTRUDER).trials != Game(watch, Infiltrator(within_s=60.0, attempts=30, seed=2)).trials


def test_intervals() -> None:
    """Wilson's for 8 of 10, and Agresti and Min's for 5 pairs that differ one way and 1 the other of 20."""
    share = share_of([True] * 8 + [False] * 2)
    assert (share.percent, share.low, share.high) == pytest.approx((80.0, 49.02, 94.33), abs=0.01)
    won = np.array([True] * 5 + [False] + [True] * 14)
    without = np.array([False] * 5 + [True] + [True] * 14)
    gain = gain_of(won, without)
    middle, spread = 100 * 4 / 22, 100 * (7.0 - 16 / 22) ** 0.5 / 22
    assert gain.percent == pytest.approx(20.0)
    assert (gain.low, gain.high) == pytest.approx((middle - 1.96 * spread, middle + 1.96 * spread), abs=0.01)
    agreed = gain_of(np.ones(20, dtype=np.bool_), np.ones(20, dtype=np.bool_))
    assert agreed.low < agreed.percent == 0.0 < agreed.high


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"within_s": 120.0}, "has 500 s, and a moving intruder, which watches and then plans over 120 s, needs 600"),
        ({"stay_s": 60.0, "within_s": 60.0}, "stay_s = 60: does not fit into 60 s"),
        ({"speed": 0.0}, "speed = 0.0: expected a number from 0.1 to 10"),
        ({"attempts": 0}, "attempts = 0: expected a number from 1"),
        ({"attempts": 2.5}, "attempts = 2.5: expected a whole number"),
        ({"entries": "roof"}, "entries = .?roof.?: expected edge, doors, or the corners of a polygon"),
    ],
)
def test_games_that_cannot_be_are_one_line(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        Game(watched(ring(500.0), 40), Infiltrator(**settings))
