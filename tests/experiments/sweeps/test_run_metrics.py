"""Figures of a run that its summary does not have: belief against truth, and the shares of intruder games."""

from pathlib import Path
from typing import Any

import pytest

import fogwatch
from experiments.intruders.infiltrator import Infiltrator
from experiments.intruders.on_run import Moving, games_of
from experiments.sweeps.run_metrics import GAINED, INTRUDERS, BeliefError, game_metric, moving_metric
from experiments.sweeps.worker import run_scenario
from fogwatch.inprocess import run_in_process
from monitor.replay.run import open_run
from patrol.scenario import load_scenario

# Not the product's own, so that a wrong one there is noticed.
ATTACKS_S = (25.0, 50.0, 75.0, 100.0, 125.0, 150.0)
EVERY = 50


def error_with(*faults: dict[str, Any], ticks: int = 6 * EVERY) -> dict[str, float | None]:
    base = {"terrain": {"builtin": "open"}, "point": 1.0, "duration": ticks * 0.5, "robots": {"count": 3}}
    belief = BeliefError()
    run_in_process(load_scenario({**base, "faults": list(faults)}), keep=False, verify_fog=False, look=belief.look)
    return belief.metrics()


def test_who_hears_everything_believes_the_truth() -> None:
    assert error_with() == {"belief_error_s": 0.0, "believed_fresher": 0.0}


def test_silence_makes_points_look_staler_and_never_fresher() -> None:
    found = error_with({"kind": "silence", "who": "all"})
    assert (found["belief_error_s"] or 0.0) > 5.0
    assert found["believed_fresher"] == 0.0


def test_forged_positions_make_points_look_fresher() -> None:
    found = error_with({"kind": "spoof", "as": "all", "payload": {"offset": [20, 0]}})
    assert (found["believed_fresher"] or 0.0) > 0.02


@pytest.mark.parametrize("ahead", [1, 64, 10**6])
def test_who_speaks_of_ticks_to_come_changes_nothing(ahead: int) -> None:
    """From the first tick on, in everybody's name: nobody is silenced, and all is heard in its tick."""
    found = error_with({"kind": "spoof", "as": "all", "payload": {"ahead": ahead}})
    assert found == {"belief_error_s": 0.0, "believed_fresher": 0.0}


def test_a_short_run_has_no_looks() -> None:
    assert error_with(ticks=EVERY - 1) == {"belief_error_s": None, "believed_fresher": None}


# --- intruder games: the same shares as those that are found in a run's journal --------------------------------------


GRAPH = {"vertices": [[10, 10], [30, 10], [60, 60]], "edges": [[0, 1, 20], [1, 2, 60]], "visit": 3.0}
SCENARIO = {
    "terrain": {"builtin": "open", "graph": GRAPH},
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
    graded = {**short, "sensor": {"quality": 0.5}}
    for facts, games, word in ((short, True, "moving"), (short, False, "intruder"), (graded, True, "intruder")):
        assert not [name for name in run_scenario(load_scenario(facts), games=games)[1] if word in name]
