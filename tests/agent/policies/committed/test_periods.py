"""Periods: the round as long as it keeps its promise, free choices by chance or where they are better."""

from __future__ import annotations

import pytest

from agent.policies.committed.periods import GOOD, Periods

LENGTH = 100
INTERVAL = 40.0


def periods(unpredictability: float = 0.0, chance: float = 0.5) -> Periods:
    return Periods(LENGTH, unpredictability, lambda _: chance)


def live(periods: Periods, period: int, mfow: int, team: int = 3, certain: bool = True) -> bool:
    """Live through a period; whether it is one on the round."""
    ticks = range(period * LENGTH, (period + 1) * LENGTH)
    return {periods.update(tick, mfow, team, INTERVAL, certain=certain) for tick in ticks}.pop()


def test_a_good_round_is_kept_to() -> None:
    fleet = periods()
    assert [live(fleet, period, round(INTERVAL)) for period in range(6)] == [True] * 6


def test_after_a_bad_round_free_choices_are_tried_and_the_better_is_kept() -> None:
    bad, worse = round(2.0 * GOOD * INTERVAL), round(3.0 * GOOD * INTERVAL)
    fleet = periods()
    assert live(fleet, 0, bad)
    assert [live(fleet, period, worse) for period in (1,)] == [False]
    assert [live(fleet, period, bad) for period in (2, 3)] == [True, True]
    other = periods()
    assert live(other, 0, worse)
    assert [live(other, period, bad) for period in (1, 2, 3)] == [False] * 3


def test_only_the_settled_part_of_a_period_is_judged() -> None:
    fleet = periods()
    for tick in range(LENGTH):
        fleet.update(tick, 10**6 if tick < LENGTH // 2 else round(INTERVAL), 3, INTERVAL, certain=True)
    assert live(fleet, 1, round(INTERVAL))


def test_nothing_is_learnt_from_a_period_in_which_others_were_not_heard() -> None:
    fleet = periods()
    assert [live(fleet, period, 10**6, certain=False) for period in range(4)] == [True] * 4


def test_nothing_is_learnt_from_a_period_in_the_midst_of_which_the_round_began() -> None:
    fleet = Periods(LENGTH, 0.0, lambda _: 0.5, since=40)
    for tick in range(40, LENGTH):
        assert fleet.update(tick, 10**6, 3, INTERVAL, certain=True)
    assert live(fleet, 1, 10**6)
    assert not live(fleet, 2, 10**6)


def test_another_team_begins_without_experience() -> None:
    fleet = periods()
    assert live(fleet, 0, 10**6)
    assert not live(fleet, 1, 10**6 + 1)
    assert not fleet.update(2 * LENGTH, 0, 3, INTERVAL, certain=True) or fleet.experience
    assert live(fleet, 3, 0, team=2)


@pytest.mark.parametrize(("unpredictability", "on_round"), [(0.0, True), (0.4, True), (0.6, False), (1.0, False)])
def test_a_period_is_free_with_the_probability_that_is_asked_for(unpredictability: float, on_round: bool) -> None:
    assert live(periods(unpredictability, chance=0.5), 0, 0) is on_round
