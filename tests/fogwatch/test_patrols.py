"""The three named patrols: what a name sets, and how runs name theirs."""

from pathlib import Path
from typing import Any

import pytest

from fogwatch.inprocess import run_in_process
from patrol.scenario import load_scenario
from patrol.scenario.patrols import PATROLS, PREDICTABLE, describe_patrol, patrol_settings
from patrol.scenario.policies import BUILT_IN
from tests.fogwatch.conftest import Refused, Shell

YARDS = {"terrain": {"builtin": "yards"}}


def test_each_built_in_policy_has_a_name_and_the_first_is_the_default() -> None:
    policies = [load_scenario(YARDS, patrol_settings(name, {})).patrol.policy for name in PATROLS]
    assert sorted(policies) == sorted(BUILT_IN)
    assert policies[0] == load_scenario(YARDS).patrol.policy
    assert patrol_settings(None, {"patrol.policy": "sebs"}) == {}


def test_the_tour_alone_is_predictable_and_rivals_keep_their_names() -> None:
    described = [describe_patrol(patrol.policy) for patrol in PATROLS.values()]
    assert described == ["stochastic", "paper", f"tour, {PREDICTABLE}"]
    assert describe_patrol("tour") == "policy tour"


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["--patrol", "tuor"], "patrol tuor: no such patrol; did you mean tour?"),
        (["--patrol", "hpcc"], "stochastic, paper, tour; for any other policy give --set patrol.policy=POLICY"),
        (["--patrol", "tour", "--set", "patrol.policy=sebs"], "patrol tour: patrol.policy is set as well, by a preset"),
        (["--patrol", "tour", "--set", "patrol={}"], "patrol tour: patrol is set as well, by a preset or by itself"),
        (["--patrol", "paper", "--preset", "letter"], "patrol paper: patrol.policy is set as well, by a preset"),
    ],
)
def test_a_name_that_means_nothing_or_two_things_is_refused(words: list[str], problem: str, refused: Refused) -> None:
    for command in (["run"], ["scenario", "show"]):
        assert problem in refused(*command, "yards", *words)


def test_a_run_names_its_patrol_at_the_start_and_the_end(shell: Shell, tmp_path: Path) -> None:
    short = ["--robots", "2", "--duration", "2", "--point", "1", "--in-process", "--no-picture", "--no-recording"]
    shown = shell("run", "yards", *short, "--patrol", "tour", "--out", tmp_path / "run")
    assert shown.code == 0
    assert f"patrol: tour, {PREDICTABLE}" in shown.err
    assert f"patrol      tour, {PREDICTABLE}" in shown.out
    assert f"patrol: tour, {PREDICTABLE}" in (tmp_path / "run" / "report.html").read_text()


@pytest.mark.parametrize(
    ("policy", "settings", "shares"),
    [
        ("committed", {}, {1.0}),
        ("stochastic", {}, {1.0}),
        ("committed", {"robots": [{"speed": 1.0}, {"speed": 2.0}]}, {1.0}),
        ("stochastic", {"sensor": {"range": 10, "angle": 120}}, {0.0}),
        ("potential-field", {}, {None}),
    ],
)
def test_a_summary_says_how_much_of_the_time_was_planned(
    policy: str, settings: dict[str, Any], shares: set[float | None]
) -> None:
    base = {**YARDS, "point": 1.0, "duration": 60, "robots": {"count": 2}, "patrol": {"policy": policy}}
    outcome = run_in_process(load_scenario({**base, **settings}))
    robots = outcome.summary.robots.values()
    assert {outcome.summary.planned_share, *(robot.planned_share for robot in robots)} == shares
    assert outcome.verdict.valid


def test_time_in_which_a_plan_is_worked_out_is_time_without_one() -> None:
    """Much is lost from 200 s on, so robots have as much of the common plan to work out then."""
    faults = [{"kind": "loss", "rate": 0.5, "at": 200}]
    summary = run_in_process(
        load_scenario({**YARDS, "point": 1.0, "duration": 240, "robots": {"count": 2}, "faults": faults})
    ).summary
    assert 0.0 < (summary.planned_share or 0.0) < 1.0
