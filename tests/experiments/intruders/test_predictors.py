"""Predictors on patrols whose future is known."""

import numpy as np
import pytest
from numpy.typing import NDArray

from experiments.intruders.predictors import Past, predictors_of
from experiments.intruders.watch import Watch
from tests.experiments.intruders.made_up import ring, watched

# Not the product's own, so that a wrong one there is noticed.
EACH = 10
SIMILAR = 5

NOW, AHEAD = 1500, 120


@pytest.fixture(scope="module")
def patrol() -> Watch:
    """A round of 56 s, for 900 s."""
    return watched(ring(900.0), 40)


def test_a_round_is_predicted_from_its_past(patrol: Watch) -> None:
    past = Past(patrol, AHEAD)
    truth = predictors_of(past)["future"](NOW, AHEAD)
    assert (truth == patrol.seen(NOW + 1, NOW + 1 + AHEAD)).all()
    rate = past.base_rate(NOW)
    for predictor, moments in (("similar", SIMILAR), ("each", EACH)):
        expected = (moments * truth + rate) / (moments + 1)
        off = np.abs(predictors_of(past)[predictor](NOW, AHEAD) - expected).sum() / truth.sum()
        assert off < 0.001


def test_beyond_a_minute_a_robot_may_be_anywhere(patrol: Watch) -> None:
    past = Past(patrol, 160)
    chances = predictors_of(past)["each"](NOW, 160)
    assert (chances[120:] == past.base_rate(NOW)).all()


def test_the_base_rate_is_the_share_of_the_past(patrol: Watch) -> None:
    rate = Past(patrol, AHEAD).base_rate(NOW)
    assert rate == pytest.approx(patrol.seen(0, 1200).mean(axis=0))


def test_the_last_picture_stays_and_the_blind_see_nothing(patrol: Watch) -> None:
    past = Past(patrol, AHEAD)
    picture, blind = (predictors_of(past)[name](NOW, 3) for name in ("picture", "blind"))
    assert np.array_equal(picture, np.repeat(patrol.seen(NOW, NOW + 1), 3, axis=0))
    assert np.array_equal(blind, np.zeros(picture.shape))


def test_robots_that_are_not_there_are_likened_to_nothing() -> None:
    """The second robot leaves; the first is still predicted, also from what the second did."""
    places = ring(900.0, robots=2)
    places[1400:, 1] = np.nan
    past = Past(watched(places, 40), AHEAD)
    chances = predictors_of(past)["each"](NOW, AHEAD)
    truth = predictors_of(past)["future"](NOW, AHEAD)
    assert chances[truth == 1.0].mean() > 0.7
    assert chances[truth == 0.0].mean() < 0.1


WANDER_NOW, WANDER_AHEAD = 700, 130
"""Tick that was seen last, and ticks predicted: 65 s, which is more than robots are followed for."""


def wander() -> NDArray[np.float64]:
    """Two robots that wander over a square of 12 m, one of which is not there at first."""
    dice = np.random.default_rng(7)
    places = (np.cumsum(dice.integers(-1, 2, (900, 2, 2)), axis=0) % 12).astype(np.float64)
    places[:260, 1] = np.nan
    return places


def taken(off: NDArray[np.float64], count: int) -> list[tuple[int, int]]:
    """The moments and robots, (ticks, robots), that are off least, no two of one robot within 5 s of each other."""
    found: list[tuple[int, int]] = []
    for tick, robot in sorted(np.ndindex(*off.shape), key=lambda place: (off[place], place)):
        if all(other != robot or abs(tick - moment) > 10 for moment, other in found):
            found.append((tick, robot))
        if len(found) == count:
            break
    return found


def test_similar_moments_are_those_with_the_fewest_other_points_now_and_three_seconds_before() -> None:
    """Moments from 100 s on, after which all that is predicted has been seen; ticks are of half a second."""
    watch = watched(wander(), 12, range_m=2.0)
    seen = watch.seen(0, 900).astype(np.float64)
    off = np.array([
        [(seen[t] != seen[WANDER_NOW]).sum() + (seen[t - 6] != seen[WANDER_NOW - 6]).sum()]
        for t in range(200, WANDER_NOW - WANDER_AHEAD)
    ], dtype=np.float64)  # fmt: skip
    after = [seen[200 + t + 1 : 200 + t + 1 + WANDER_AHEAD] for t, _ in taken(off, SIMILAR)]
    past = Past(watch, WANDER_AHEAD)
    expected = (np.sum(after, axis=0) + past.base_rate(WANDER_NOW)) / (SIMILAR + 1)
    assert predictors_of(past)["similar"](WANDER_NOW, WANDER_AHEAD) == pytest.approx(expected, abs=1e-5)


def test_each_robot_goes_on_like_those_that_were_nearest_to_its_place_now_and_three_seconds_before() -> None:
    places = wander()
    alone = [watched(places[:, [robot]], 12, range_m=2.0).seen(0, 900).astype(np.float64) for robot in (0, 1)]
    unseen = np.ones((120, 144))
    for robot in (0, 1):
        off = np.array([
            [
                np.square(places[t, other] - places[WANDER_NOW, robot]).sum()
                + np.square(places[t - 6, other] - places[WANDER_NOW - 6, robot]).sum()
                for other in (0, 1)
            ]
            for t in range(200, WANDER_NOW - 120)
        ])  # fmt: skip
        nearest = taken(np.where(np.isnan(off), np.inf, off), EACH)
        after = [alone[other][200 + t + 1 : 200 + t + 1 + 120] for t, other in nearest]
        unseen *= 1.0 - np.mean(after, axis=0)
    past = Past(watched(places, 12, range_m=2.0), WANDER_AHEAD)
    expected = (EACH * (1.0 - unseen) + past.base_rate(WANDER_NOW)) / (EACH + 1)
    found = predictors_of(past)["each"](WANDER_NOW, WANDER_AHEAD)
    assert found[:120] == pytest.approx(expected, abs=1e-5)
    assert (found[120:] == past.base_rate(WANDER_NOW)).all()


@pytest.mark.parametrize(("now", "last"), [(199, 200), (599, 200), (600, 600), (899, 600)])
def test_the_base_rate_is_computed_anew_every_five_minutes(now: int, last: int) -> None:
    """Before the first five minutes are over, it is that of the first 100 s."""
    watch = watched(wander(), 12, range_m=2.0)
    assert Past(watch, 60).base_rate(now) == pytest.approx(watch.seen(0, last).mean(axis=0), abs=1e-6)
