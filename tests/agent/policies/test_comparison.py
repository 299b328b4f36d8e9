"""Round or free choices: what robots measure decides, and is measured again."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from agent.policies.committed import BROKEN, PERIOD_S, PERIODS, Comparison

STEP = 0.5
TOUR_S, ROBOTS = 80.0, 2
PROMISED_S = TOUR_S / ROBOTS


def periods(
    round_s: float,
    free_s: float,
    number: int,
    joined: float = 0.0,
    robots: int = ROBOTS,
    lossy: bool = False,
    crowded: bool = False,
) -> str:
    """The mode of each period, R or F, for a robot that joins then; ground gets so old on the round and freely."""
    comparison = Comparison(STEP, TOUR_S, ROBOTS, crowded)
    modes = ""
    for tick in range(int(joined * PERIOD_S / STEP), int(number * PERIOD_S / STEP)):
        mfow_s = round_s if comparison.on_round else free_s
        view: Any = SimpleNamespace(tick=tick, fog=SimpleNamespace(mfow=lambda _tick, s=mfow_s: round(s / STEP)))
        comparison.note(view, robots, lossy)
        if tick % (PERIOD_S / STEP) == 1:
            modes += "R" if comparison.on_round else "F"
    return modes


@pytest.mark.parametrize("free_s", [10.0, 100.0])
def test_a_round_that_keeps_its_promise_is_followed(free_s: float) -> None:
    assert periods(0.99 * BROKEN * PROMISED_S, free_s, 6) == "RRRRRR"


def test_a_round_that_does_not_is_left_for_free_choices_if_they_are_fresher() -> None:
    assert periods(60.0, 50.0, PERIODS) == "RFFFFF"
    assert periods(60.0, 70.0, PERIODS) == "RFRRRR"


def test_crowded_robots_try_free_choices_in_any_case() -> None:
    assert periods(0.7 * PROMISED_S, 0.5 * PROMISED_S, PERIODS, crowded=True) == "RFFFFF"
    assert periods(0.7 * PROMISED_S, 0.9 * PROMISED_S, PERIODS, crowded=True) == "RFRRRR"


def test_fewer_robots_are_promised_less() -> None:
    assert periods(1.2 * TOUR_S, 50.0, 3, robots=1) == "RRR"


def test_where_many_positions_are_lost_the_round_is_kept() -> None:
    assert periods(60.0, 50.0, 3, lossy=True) == "RRR"


def test_the_round_is_tried_again() -> None:
    assert periods(60.0, 50.0, 2 * PERIODS + 2) == "RFFFFFRFFFFFRF"


@pytest.mark.parametrize("joined", [1.1, 2.4, 3.9])
def test_a_robot_that_joins_agrees_from_the_next_beginning_on(joined: float) -> None:
    """Its own fog of the period in which it joins says nothing of what the fleet keeps."""
    later = periods(60.0, 50.0, 2 * PERIODS, joined)
    assert later[-PERIODS:] == periods(60.0, 50.0, PERIODS)
    assert periods(1e4, 50.0, int(joined) + 2, joined) == "R"
