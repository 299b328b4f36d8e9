"""Bearings that are worked out when somebody asks for them."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import pytest

from agent.answers import checked
from agent.policies.potential_field.lazy import Ranking
from agent.ports import Bearing
from experiments.inprocess import Outcome, run_in_process
from patrol.scenario import open_scenario

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


def test_checking_an_answer_of_ours_works_nothing_out() -> None:
    ranking = Asked(1)
    answer = checked(Bearing(cast(Any, ranking)), ours=True)
    assert isinstance(answer, Bearing)
    assert cast(Any, answer.bearings) is ranking
    assert ranking.times == 0


def test_of_any_other_policy_a_ranking_is_read_at_once() -> None:
    ranking = Asked(1)
    answer = checked(Bearing(cast(Any, ranking)))
    assert isinstance(answer, Bearing)
    assert type(answer.bearings) is tuple
    assert list(answer.bearings) == WHOLE
    assert ranking.times == 1


WRAPPER = """
import pickle

from dataclasses import replace

from agent.policies.potential_field.policy import PotentialField
from agent.ports import Bearing


class Wrapper:
    def __init__(self, setup):
        self.inner = PotentialField(setup)
        self.kept = None

    def decide(self, view):
        if self.kept is None or view.tick % 5 == 0:
            self.kept = self.inner.decide(view)
            assert pickle.loads(pickle.dumps(self.kept)) == self.kept
        return replace(self.kept, bearings=self.kept.bearings + (0.0,)) if isinstance(self.kept, Bearing) else self.kept


class Extended(PotentialField):
    pass
"""


def drive(folder: Path, name: str | None) -> Outcome:
    """Three cars with the paper's policy, or with one of those above."""
    settings: dict[str, Any] = {"point": 0.5, "duration": 20, "robots.count": 3, "patrol.policy": "potential-field"}
    if name is not None:
        path = folder / "wrapper.py"
        path.write_text(WRAPPER, encoding="utf-8")
        settings["patrol.policy"] = f"{path}:{name}"
    return run_in_process(open_scenario("yards", settings))


def test_who_wraps_the_papers_policy_adds_to_its_bearings_and_keeps_them(tmp_path: Path) -> None:
    outcome = drive(tmp_path, "Wrapper")
    assert outcome.verdict.valid, outcome.verdict.failed


def test_who_extends_the_papers_policy_gets_tuples_and_drives_as_it_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[Ranking] = []

    class Counted(Ranking):
        def __init__(self, *asked: Any) -> None:
            super().__init__(*asked)
            made.append(self)

    monkeypatch.setattr("agent.policies.potential_field.lazy.Ranking", Counted)
    poses, rankings = [], []
    for name in (None, "Extended"):
        ticks = drive(tmp_path, name).journal.ticks
        poses.append([(row.x, row.y, row.heading, row.c0, row.c1) for record in ticks for row in record.robots])
        rankings.append(len(made))
    assert poses[0] == poses[1]
    assert 0 < rankings[0] == rankings[1]
