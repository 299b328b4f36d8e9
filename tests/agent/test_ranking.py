"""Bearings that are worked out when somebody asks for them."""

from __future__ import annotations

import pytest

from agent.answers import checked
from agent.ports import Bearing, Ranking

WHOLE = [0.5, 1.5, -1.0, 2.0]


class Asked(Ranking):
    """Counts how often all bearings were worked out."""

    def __init__(self, known: int) -> None:
        self.times = 0
        super().__init__(WHOLE[:known], self._work)

    def _work(self) -> list[float]:
        self.times += 1
        return WHOLE


@pytest.mark.parametrize("known", [1, 2, 4])
def test_what_is_known_costs_nothing_and_all_the_rest_is_worked_out_once(known: int) -> None:
    ranking = Asked(known)
    assert ranking
    assert [ranking[at] for at in range(known)] == WHOLE[:known]
    assert WHOLE[known - 1] in ranking
    assert None not in ranking
    bearings = iter(ranking)
    assert [next(bearings) for _ in range(known)] == WHOLE[:known]
    assert ranking.times == 0
    assert list(bearings) == WHOLE[known:]
    assert list(ranking) == WHOLE
    assert len(ranking) == 4
    assert ranking[-1] == 2.0
    assert ranking[1:3] == (1.5, -1.0)
    assert 9.0 not in ranking
    assert ranking.times == 1


def test_checking_an_answer_works_nothing_out() -> None:
    ranking = Asked(1)
    answer = checked(Bearing(ranking))
    assert isinstance(answer, Bearing)
    assert answer.bearings is ranking
    assert ranking.times == 0
