"""Predictors on a patrol whose future is known."""

import numpy as np
import pytest

from experiments.intruders.predictors import Past, predictors_of
from experiments.intruders.watch import Watch
from tests.experiments.intruders.made_up import ring, wander, watched

NOW, AHEAD = 1500, 120


@pytest.fixture(scope="module")
def patrol() -> Watch:
    """A round of 56 s, for 900 s."""
    return watched(ring(900.0), 40)


def test_who_knows_the_future_predicts_it(patrol: Watch) -> None:
    truth = predictors_of(Past(patrol))["future"](NOW, AHEAD)
    assert (truth == patrol.seen(NOW + 1, NOW + 1 + AHEAD)).all()


def test_the_base_rate_is_the_share_of_the_past(patrol: Watch) -> None:
    assert Past(patrol).base_rate(NOW) == pytest.approx(patrol.seen(0, 1200).mean(axis=0))


def test_the_last_picture_stays_and_the_blind_see_nothing(patrol: Watch) -> None:
    picture, blind = (predictors_of(Past(patrol))[name](NOW, 3) for name in ("picture", "blind"))
    assert np.array_equal(picture, np.repeat(patrol.seen(NOW, NOW + 1), 3, axis=0))
    assert np.array_equal(blind, np.zeros(picture.shape))


@pytest.mark.parametrize(("now", "last"), [(199, 200), (599, 200), (600, 600), (899, 600)])
def test_the_base_rate_is_computed_anew_every_five_minutes(now: int, last: int) -> None:
    """Before the first five minutes are over, it is that of the first 100 s."""
    watch = watched(wander(), 12, range_m=2.0)
    assert Past(watch).base_rate(now) == pytest.approx(watch.seen(0, last).mean(axis=0), abs=1e-6)
