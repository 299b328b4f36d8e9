"""Intruder games in a sweep: the same shares as `fogwatch intruder` finds in the run's journal."""

from __future__ import annotations

from pathlib import Path

import pytest

import fogwatch
from experiments.intruders.infiltrator import Infiltrator
from experiments.intruders.on_run import Moving, games_of
from experiments.intruders.standing import ATTACKS_S
from experiments.sweeps.run_metrics import GAINED, INTRUDERS, game_metric, moving_metric
from experiments.sweeps.worker import run_scenario
from monitor.replay.run import open_run
from patrol.scenario import load_scenario

SCENARIO = {
    "terrain": {
        "builtin": "open",
        "graph": {"vertices": [[10, 10], [30, 10], [60, 60]], "edges": [[0, 1, 20], [1, 2, 60]], "visit": 3.0},
    },
    "point": 2.0,
    "duration": 600,
    "robots": {"count": 3, "model": "holonomic", "starts": [[10, 10], [50, 44]]},
    "faults": [{"kind": "kill", "who": "r2", "at": 20}],
}


def test_the_shares_are_those_of_the_journal(tmp_path: Path) -> None:
    _, metrics = run_scenario(load_scenario(SCENARIO), games=True)
    run = open_run(fogwatch.run(SCENARIO, out=tmp_path / "run", picture=False, report=False, recording=False).folder)
    games = games_of(run, ATTACKS_S, moving=Moving(Infiltrator()))
    for on, shares in (("ground", games.ground), ("nodes", games.nodes)):
        for share in shares:
            for intruder in INTRUDERS:
                expected = getattr(share, intruder)
                found = metrics[game_metric(intruder, share.attack_s, on)]
                assert found == (None if expected is None else pytest.approx(100.0 * expected))
    assert games.moving is not None
    for predictor, success in games.moving.once.items():
        assert metrics[moving_metric(predictor)] == pytest.approx(success.percent)
    assert metrics[GAINED] == pytest.approx(games.moving.gain.watching.percent)
    assert 0.0 < (metrics["intruder_random_25s_percent"] or 0.0) < 100.0
    assert 0.0 < (metrics["nodes_intruder_random_25s_percent"] or 0.0) < 100.0


def test_there_are_none_unless_asked_or_where_the_fog_does_not_show_them() -> None:
    short = {**SCENARIO, "duration": 5, "faults": []}
    assert not [name for name in run_scenario(load_scenario(short), games=True)[1] if "moving" in name]
    assert not [name for name in run_scenario(load_scenario(short))[1] if "intruder" in name]
    graded = load_scenario({**short, "sensor": {"quality": 0.5}})
    assert not [name for name in run_scenario(graded, games=True)[1] if "intruder" in name]
