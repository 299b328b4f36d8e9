"""Belief against truth: equal while everything is heard, off by what is missed or forged."""

from __future__ import annotations

from typing import Any

import pytest

from experiments.sweeps.run_metrics import EVERY, BeliefError
from fogwatch.inprocess import run_in_process
from patrol.scenario import load_scenario


def error_with(*faults: dict[str, Any], ticks: int = 6 * EVERY) -> dict[str, float | None]:
    base = {"terrain": {"builtin": "open"}, "point": 1.0, "duration": ticks * 0.5, "robots": {"count": 3}}
    belief = BeliefError()
    run_in_process(load_scenario({**base, "faults": list(faults)}), keep=False, verify_fog=False, look=belief.look)
    return belief.metrics()


def test_who_hears_everything_believes_the_truth() -> None:
    assert error_with() == {"belief_error_s": 0.0, "believed_fresher": 0.0}


def test_silence_makes_points_look_staler_and_never_fresher() -> None:
    found = error_with({"kind": "silence", "who": "all"})
    assert found["belief_error_s"] is not None
    assert found["belief_error_s"] > 5.0
    assert found["believed_fresher"] == 0.0


def test_forged_positions_make_points_look_fresher() -> None:
    found = error_with({"kind": "spoof", "as": "all", "payload": {"offset": [20, 0]}})
    assert found["believed_fresher"] is not None
    assert found["believed_fresher"] > 0.02


@pytest.mark.parametrize("ahead", [1, 64, 10**6])
def test_who_speaks_of_ticks_to_come_changes_nothing(ahead: int) -> None:
    """From the first tick on, in everybody's name: nobody is silenced, and all is heard in its tick."""
    found = error_with({"kind": "spoof", "as": "all", "payload": {"ahead": ahead}})
    assert found == {"belief_error_s": 0.0, "believed_fresher": 0.0}


def test_a_short_run_has_no_looks() -> None:
    assert error_with(ticks=EVERY - 1) == {"belief_error_s": None, "believed_fresher": None}
