"""Phases: the round as long as it keeps its promise, free choices by chance or where they are better."""

from __future__ import annotations

import pytest

from agent.policies.committed.phases import GOOD, Phases

LENGTH = 100
INTERVAL = 40.0


def phases(unpredictability: float = 0.0, chance: float = 0.5) -> Phases:
    return Phases(LENGTH, unpredictability, lambda _: chance)


def live(phases: Phases, phase: int, mfow: int, team: int = 3) -> bool:
    """Live through a phase; whether it is one on the round."""
    return {phases.update(phase * LENGTH + tick, mfow, team, INTERVAL) for tick in range(LENGTH)}.pop()


def test_a_good_round_is_kept_to() -> None:
    fleet = phases()
    assert [live(fleet, phase, round(INTERVAL)) for phase in range(6)] == [True] * 6


def test_after_a_bad_round_free_choices_are_tried_and_the_better_is_kept() -> None:
    bad, worse = round(2.0 * GOOD * INTERVAL), round(3.0 * GOOD * INTERVAL)
    fleet = phases()
    assert live(fleet, 0, bad)
    assert [live(fleet, phase, worse) for phase in (1,)] == [False]
    assert [live(fleet, phase, bad) for phase in (2, 3)] == [True, True]
    other = phases()
    assert live(other, 0, worse)
    assert [live(other, phase, bad) for phase in (1, 2, 3)] == [False] * 3


def test_only_the_settled_part_of_a_phase_is_judged() -> None:
    fleet = phases()
    for tick in range(LENGTH):
        fleet.update(tick, 10**6 if tick < LENGTH // 2 else round(INTERVAL), 3, INTERVAL)
    assert live(fleet, 1, round(INTERVAL))


def test_another_team_begins_without_experience() -> None:
    fleet = phases()
    assert live(fleet, 0, 10**6)
    assert not live(fleet, 1, 10**6 + 1)
    assert not fleet.update(2 * LENGTH, 0, 3, INTERVAL) or fleet.experience
    assert live(fleet, 3, 0, team=2)


@pytest.mark.parametrize(("unpredictability", "on_round"), [(0.0, True), (0.4, True), (0.6, False), (1.0, False)])
def test_a_phase_is_free_with_the_probability_that_is_asked_for(unpredictability: float, on_round: bool) -> None:
    assert live(phases(unpredictability, chance=0.5), 0, 0) is on_round
