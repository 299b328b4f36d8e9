"""Predictors on patrols whose future is known, and the one that watches against a plain computation."""

import numpy as np
import pytest
from numpy.typing import NDArray

from experiments.intruders.predictors import Chances, Past, predictors_of
from experiments.intruders.watch import Watch
from tests.experiments.intruders.made_up import ring, wander, watched

# Not the product's own, so that a wrong one there is noticed. Ticks are of half a second.
ANALOGS, FOLLOWED, LAG, APART = 10, 60, 6, 10
BIN, BINS, MINUTE, FEW, DOUBT = 4, 120, 120, 100, 0.01

NOW, AHEAD = 1500, 120


@pytest.fixture(scope="module")
def patrol() -> Watch:
    """A round of 56 s, for 900 s."""
    return watched(ring(900.0), 40)


def test_who_knows_the_future_predicts_it(patrol: Watch) -> None:
    truth = predictors_of(Past(patrol, AHEAD))["future"](NOW, AHEAD)
    assert (truth == patrol.seen(NOW + 1, NOW + 1 + AHEAD)).all()


def test_the_base_rate_is_the_share_of_the_past(patrol: Watch) -> None:
    assert Past(patrol, AHEAD).base_rate(NOW) == pytest.approx(patrol.seen(0, 1200).mean(axis=0))


def test_the_last_picture_stays_and_the_blind_see_nothing(patrol: Watch) -> None:
    picture, blind = (predictors_of(Past(patrol, AHEAD))[name](NOW, 3) for name in ("picture", "blind"))
    assert np.array_equal(picture, np.repeat(patrol.seen(NOW, NOW + 1), 3, axis=0))
    assert np.array_equal(blind, np.zeros(picture.shape))


@pytest.mark.parametrize(("now", "last"), [(199, 200), (599, 200), (600, 600), (899, 600)])
def test_the_base_rate_is_computed_anew_every_five_minutes(now: int, last: int) -> None:
    """Before the first five minutes are over, it is that of the first 100 s."""
    watch = watched(wander(), 12, range_m=2.0)
    assert Past(watch, AHEAD).base_rate(now) == pytest.approx(watch.seen(0, last).mean(axis=0), abs=1e-6)


def predicted(watch: Watch, now: int = NOW, ahead: int = AHEAD) -> Chances:
    return Past(watch, ahead).watching(now, ahead)


def test_a_round_is_predicted_from_its_past(patrol: Watch) -> None:
    chances, truth = predicted(patrol), patrol.seen(NOW + 1, NOW + 1 + AHEAD)
    assert np.array_equal(chances[:FOLLOWED] > 0.5, truth[:FOLLOWED] == 1)
    later, later_truth = chances[FOLLOWED:], truth[FOLLOWED:]
    assert later[later_truth == 1].mean() > 5.0 * later[later_truth == 0].mean(), "by their ages alone"


def shuffled(seed: int) -> NDArray[np.float64]:
    """A robot that is at each of nine places for 5 s, in an order that is drawn anew for every 45 s."""
    dice = np.random.default_rng(seed)
    order = np.concatenate([dice.permutation(9) for _ in range(40)])
    return np.repeat(4.0 + 10.0 * np.stack(np.divmod(order, 3), axis=1), 10, axis=0)[:, None]


@pytest.mark.parametrize("seed", range(5))
def test_points_that_are_due_by_their_age_are_expected(seed: int) -> None:
    """After five of nine places: those that were not seen in these 45 s, though robots often go to the others too."""
    now = 90 * 30 + 49
    watch = watched(shuffled(seed), 30, range_m=2.0)
    visited = watch.seen(now - 49, now + 1).any(axis=0)
    soon = predicted(watch, now)[6]
    assert soon[watch.ever_seen() & ~visited].mean() > 0.1 > 2.0 * soon[visited].mean()


def test_robots_that_are_not_there_are_likened_to_nothing() -> None:
    """The second robot leaves; the first is still predicted, also from what the second did."""
    places = ring(900.0, robots=2)
    places[1440:, 1] = np.nan
    watch = watched(places, 40)
    chances, truth = predicted(watch)[:FOLLOWED], watch.seen(NOW + 1, NOW + 1 + FOLLOWED)
    assert chances[truth == 1].mean() > 0.7
    assert chances[truth == 0].mean() < 0.1


def test_nothing_is_known_of_the_future_nor_kept_from_it() -> None:
    """Another future changes no chance, nor does it matter which moment was asked for before."""
    places = wander()
    other = places.copy()
    other[701:] = 11.0 - other[701:]
    chances = predicted(watched(places, 12, range_m=2.0), 700, 130)
    assert np.array_equal(predicted(watched(other, 12, range_m=2.0), 700, 130), chances)
    watching = Past(watched(places, 12, range_m=2.0), 130).watching
    watching(760, 130)
    assert np.array_equal(watching(700, 130), chances)
    assert np.array_equal(watching(700, 20), chances[:20])


def taken(off: NDArray[np.float64], count: int) -> list[tuple[int, int]]:
    """The moments and robots, (ticks, robots), that are off least, no two of one robot within 5 s of each other."""
    found: list[tuple[int, int]] = []
    for tick, robot in sorted(np.ndindex(*off.shape), key=lambda place: (off[place], place)):
        if all(other != robot or abs(tick - moment) > APART for moment, other in found):
            found.append((tick, robot))
        if len(found) == count:
            break
    return found


def by_robots(places: NDArray[np.float64], now: int) -> NDArray[np.float64]:
    """The chance that one of two robots sees each point, for as long as they are followed."""
    alone = [watched(places[:, [robot]], 12, range_m=2.0).seen(0, 900).astype(np.float64) for robot in (0, 1)]
    unseen = np.ones((FOLLOWED, 144))
    for robot in (0, 1):
        off = np.array([
            [
                np.square(places[t, other] - places[now, robot]).sum()
                + np.square(places[t - LAG, other] - places[now - LAG, robot]).sum()
                for other in (0, 1)
            ]
            for t in range(200, now + 1 - FOLLOWED)
        ])  # fmt: skip
        nearest = taken(np.where(np.isnan(off), np.inf, off), ANALOGS)
        after = [alone[other][200 + t + 1 : 200 + t + 1 + FOLLOWED] for t, other in nearest]
        unseen *= 1.0 - np.mean(after, axis=0)
    return 1.0 - unseen


def by_age(seen: NDArray[np.float64], now: int, ahead: int) -> NDArray[np.float64]:
    """The chance that each point is seen, by how often points of its age were."""

    def ages(tick: int) -> list[int]:
        last = [np.flatnonzero(column[: tick + 1]) for column in seen.T]
        return [min((tick - (ticks[-1] if ticks.size else -1)) // BIN, BINS - 1) for ticks in last]

    leads = np.arange(0, ahead, BIN) + 1 + BIN // 2
    sightings, points = np.zeros((len(leads), BINS)), np.zeros(BINS)
    for tick in range(200, now // MINUTE * MINUTE - ahead + 1, APART + 1):
        for point, age in enumerate(ages(tick)):
            sightings[:, age] += seen[tick + np.minimum(leads, ahead), point]
            points[age] += 1
    mean = sightings.sum(axis=1, keepdims=True) / points.sum()
    chances: NDArray[np.float64] = (sightings + FEW * mean) / (points + FEW)
    return chances[np.arange(ahead) // BIN][:, ages(now)]


def test_the_chances_are_those_of_a_plain_computation() -> None:
    now, ahead = 700, 130
    watch = watched(wander(), 12, range_m=2.0)
    expected = by_age(watch.seen(0, 900).astype(np.float64), now, ahead)
    rate = np.clip(Past(watch, ahead).base_rate(now).astype(np.float64), DOUBT, 1.0 - DOUBT)
    robots = (ANALOGS * by_robots(wander(), now) + rate) / (ANALOGS + 1)
    first, second, base = (
        chances / (1.0 - chances) for chances in (robots, np.clip(expected[:FOLLOWED], DOUBT, 1.0 - DOUBT), rate)
    )
    odds = first * second / base
    expected[:FOLLOWED] = odds / (1.0 + odds)
    assert predicted(watch, now, ahead) == pytest.approx(expected, abs=1e-5)
