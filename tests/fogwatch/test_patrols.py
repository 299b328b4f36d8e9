"""The three named patrols: what a name sets, and how runs name theirs."""

from pathlib import Path

import pytest

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
