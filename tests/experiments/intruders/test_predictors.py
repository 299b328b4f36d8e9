"""Predictors on patrols whose future is known."""

from __future__ import annotations

import numpy as np
import pytest

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
    assert (predictors_of(past)["picture"](NOW, 3) == patrol.seen(NOW, NOW + 1)).all()
    assert not predictors_of(past)["blind"](NOW, 3).any()


def test_robots_that_are_not_there_are_likened_to_nothing() -> None:
    """The second robot leaves; the first is still predicted, also from what the second did."""
    places = ring(900.0, robots=2)
    places[1400:, 1] = np.nan
    past = Past(watched(places, 40), AHEAD)
    chances = predictors_of(past)["each"](NOW, AHEAD)
    truth = predictors_of(past)["future"](NOW, AHEAD)
    assert chances[truth == 1.0].mean() > 0.7
    assert chances[truth == 0.0].mean() < 0.1
