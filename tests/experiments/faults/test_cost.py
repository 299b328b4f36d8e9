"""The faults experiment: every condition is a scenario, and costs are ratios seed by seed."""

from __future__ import annotations

from pathlib import Path

import pytest

from experiments.faults import cost
from experiments.faults.cost_page import page
from patrol.errors import BadInput
from tests.experiments.outcomes import outcome_of
from tests.present import present


@pytest.fixture
def setup(tmp_path: Path) -> cost.FaultSetup:
    key = tmp_path / "fleet.key"
    key.write_text("0123456789abcdef0123456789abcdef")
    return cost.FaultSetup("yards", 1.0, 3000.0, 5, (1, 2), key)


def test_every_condition_is_a_scenario_of_its_own(setup: cost.FaultSetup) -> None:
    tried = cost.conditions(setup)
    assert {condition.group for condition in tried} == set(cost.GROUPS)
    plan = cost.plan_of(setup, tried)
    assert len(plan.runs) == len(tried) * len(cost.VARIANTS) * 2
    assert len({run.key for run in plan.runs}) == len(plan.runs)
    for run in plan.runs:
        assert run.scenario.ticks == 6000
        assert len(run.scenario.roster) == (4 if "one robot fewer" in run.case else 5)


def test_conditions_are_those_of_the_page(setup: cost.FaultSetup) -> None:
    tried = cost.conditions(setup)
    rates, bursts = [0.1, 0.25, 0.5, 0.75, 0.9, 1.0], [0.25, 0.5, 0.75, 0.85]
    axes = {
        "loss": rates,
        "loss with trail": rates,
        "bursts": bursts,
        "bursts with trail": bursts,
        "range": [20, 40, 80],
    }
    for group, values in axes.items():
        found = [condition for condition in tried if condition.group == group]
        assert [condition.x for condition in found] == values
        for condition in found:
            (fault,) = condition.faults
            assert fault.get("rate", fault.get("reach")) == condition.x
            assert fault.get("mean_burst") == (8 if group.startswith("bursts") else None)
            assert condition.settings == ({"radio.trail": 4} if group.endswith("trail") else {})
    by_name = {condition.name: condition.faults for condition in tried}
    assert by_name["all positions shifted"][0]["payload"] == {"offset": [25.0, 0.0]}
    assert by_name["silence for a third"][0] == {"kind": "silence", "who": "all", "at": 1000.0, "for": 1000.0}
    assert [(fault["who"], fault["at"]) for fault in by_name["two robots join"]] == [("r4", 1000.0), ("r5", 2000.0)]
    assert [fault["at"] for fault in by_name["one killed and restarted"]] == [600.0, 900.0]
    assert by_name["old frames sent again"][0]["payload"] == {"replay": 60.0}


def test_all_deaths_come_and_go_within_the_run(setup: cost.FaultSetup) -> None:
    (in_turn,) = [condition for condition in cost.conditions(setup) if condition.name.startswith("each killed")]
    acts = [(fault["kind"], fault["who"], fault["at"]) for fault in in_turn.faults]
    assert [act[:2] for act in acts] == [(kind, f"r{number}") for number in range(1, 6) for kind in ("kill", "restart")]
    times = [at for *_, at in acts]
    assert times == sorted(times)
    assert times[0] > 0.0
    assert times[-1] < 3000.0


def test_groups_can_be_chosen(setup: cost.FaultSetup) -> None:
    assert {condition.group for condition in cost.chosen(setup, ["silence"])} == {"quiet", "silence"}
    assert cost.chosen(setup, []) == cost.conditions(setup)
    names = [condition.name for condition in cost.chosen(setup, ["loss: 50 % lost", "silence"])]
    assert names == ["no faults", "50 % lost", "total silence", "silence for a third"]
    with pytest.raises(BadInput, match="--only sylence: no such group or condition; did you mean silence"):
        cost.chosen(setup, ["sylence"])


def test_small_fleets_have_fewer_conditions(setup: cost.FaultSetup) -> None:
    one = cost.FaultSetup("yards", 1.0, 3000.0, 1, (1,), setup.key)
    assert not [condition for condition in cost.conditions(one) if condition.group == "fleet"]
    assert cost.plan_of(one, cost.conditions(one)).runs


def test_costs_are_ratios_to_the_same_seed_without_faults(setup: cost.FaultSetup) -> None:
    tried = cost.chosen(setup, ["silence"])

    def metrics(case: str, seed: int) -> dict[str, float]:
        mfow = 100.0 * seed * (1.5 if "total silence" in case else 1.0)
        return {"mfow_mean_s": mfow, "messages_sent": 200.0, "messages_delivered": 50.0}

    found = cost.findings(outcome_of(cost.plan_of(setup, tried), metrics), tried)
    by_name = {cost.case_name(one.condition, one.variant): one for one in found}
    silent = by_name["silence: total silence, with claims"]
    assert silent.cost is not None
    assert silent.cost.mean == pytest.approx(1.5)
    assert silent.cost.half == pytest.approx(0.0)
    assert present(silent.mfow).mean == pytest.approx(225.0)
    assert present(silent.delivered).mean == 0.25
    assert silent.belief is None
    command = "fogwatch reproduce faults"
    text = page(setup, found, [], command=command, computing_s=600.0, failed=2, pictures=["loss.png"])
    assert "`fogwatch reproduce faults`: 10 min of computing" in text
    assert "| total silence | with claims | 225.0 ± " in text
    assert "| 1.500 ± 0.000 | - | 25.0 % |" in text
    assert "**2 runs failed" in text
    assert "![loss.png](loss.png)" in text
    says = cost.as_json(setup, found, [])
    assert {one["variant"] for one in says["findings"]} == set(cost.VARIANTS)


def test_runs_are_compared_seed_by_seed(setup: cost.FaultSetup) -> None:
    names = ["loss: 50 % lost", "loss with trail: 50 % lost", "death: one killed", "fleet: one robot fewer"]
    tried = cost.chosen(setup, names)

    def metrics(case: str, seed: int) -> dict[str, float]:
        mfow = 100.0 * seed * (0.7 if "with claims" in case else 1.0) * (0.9 if "trail" in case else 1.0)
        return {"mfow_mean_s": mfow, "mfow_late_mean_s": 80.0 * seed * (1.1 if "killed" in case else 1.0)}

    compared = cost.comparisons(outcome_of(cost.plan_of(setup, tried), metrics), tried)
    ratios = {(one.group, one.what, one.variant): round(one.ratio.mean, 6) for one in compared}
    assert ratios["claims", "loss: 50 % lost", "with claims"] == 0.7
    assert ratios["trail", "loss: 50 % lost", "final algorithm"] == 0.9
    assert ratios["fleet", "one killed: one robot fewer", "with claims"] == 1.1
    claimed = {what for group, what, _ in ratios if group == "claims"}
    assert claimed == {f"{condition.group}: {condition.name}" for condition in tried}
    assert {what for group, what, _ in ratios if group == "trail"} == {"loss: 50 % lost"}
    text = page(setup, [], compared, command="fogwatch reproduce faults", computing_s=1.0, failed=0, pictures=[])
    assert "| loss: 50 % lost | with claims | 0.700 ± 0.000 |" in text
    assert len(cost.as_json(setup, [], compared)["comparisons"]) == len(compared)
