"""Round or free choices: what robots measure decides, and is measured again."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from agent.policies.committed.comparison import BROKEN, PERIOD_S, REMEMBERED, Comparison

STEP = 0.5
TOUR_S, ROBOTS = 80.0, 2  # the round promises 40 s


def periods(round_s: float, free_s: float, number: int) -> str:
    """How each period goes where the ground is so old on the round, and with free choices: R or F for each."""
    comparison = Comparison(STEP, TOUR_S)
    said = ""
    for period in range(number):
        for tick in range(int(period * PERIOD_S / STEP), int((period + 1) * PERIOD_S / STEP)):
            mfow_s = round_s if comparison.on_round else free_s
            view: Any = SimpleNamespace(tick=tick, fog=SimpleNamespace(mfow=lambda _tick, s=mfow_s: round(s / STEP)))
            comparison.note(view, ROBOTS)
        said += "R" if comparison.on_round else "F"
    return said


@pytest.mark.parametrize("free_s", [10.0, 100.0])
def test_a_round_that_keeps_its_promise_is_followed(free_s: float) -> None:
    assert periods(0.99 * BROKEN * TOUR_S / ROBOTS, free_s, 6) == "RRRRRR"


def test_a_round_that_does_not_is_left_for_free_choices_if_they_are_fresher() -> None:
    assert periods(60.0, 50.0, REMEMBERED) == "R" + (REMEMBERED - 1) * "F"
    assert periods(60.0, 70.0, REMEMBERED) == "RF" + (REMEMBERED - 2) * "R"


def test_both_are_tried_again_after_a_while() -> None:
    assert "FRF" in periods(60.0, 50.0, 3 * REMEMBERED)
    assert "RFR" in periods(60.0, 70.0, 3 * REMEMBERED)[2:]


def test_a_robot_that_comes_later_decides_with_the_others() -> None:
    """Periods count from the fleet's first tick, and what was not measured says nothing."""
    comparison = Comparison(STEP, TOUR_S)
    for tick in (int(4.9 * PERIOD_S / STEP), int(5.1 * PERIOD_S / STEP)):
        view: Any = SimpleNamespace(tick=tick, fog=SimpleNamespace(mfow=lambda _tick: 1000))
        comparison.note(view, ROBOTS)
    assert comparison.on_round
