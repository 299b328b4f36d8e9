"""The sweeps in examples/sweeps: each can be planned, and those of faults compare what they say."""

from pathlib import Path

import pytest

from experiments.sweeps.plan import read_plan

EXAMPLES = sorted((Path(__file__).parents[3] / "examples" / "sweeps").glob("*.yaml"))


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_each_example_is_a_plan_of_as_many_runs_as_it_says(file: Path) -> None:
    plan = read_plan(file)
    assert len({run.key for run in plan.runs}) == len(plan.runs)
    head = file.read_text(encoding="utf-8").partition("base:")[0]
    assert f"{len(plan.runs)} runs" in head


@pytest.mark.parametrize("name", ["faults", "fault-kinds"])
def test_each_fault_is_compared_with_none_in_the_same_variant(name: str) -> None:
    (file,) = [file for file in EXAMPLES if file.stem == name]
    plan = read_plan(file)
    quiet = {f"no faults {variant}" for variant in ("final algorithm", "with claims")}
    assert set(plan.partners) == {case.name for case in plan.cases} - quiet
    assert set(plan.partners.values()) == quiet
    for case, partner in plan.partners.items():
        assert case.endswith(partner.removeprefix("no faults "))
    for run in plan.runs:
        assert len(run.scenario.roster) == (4 if "one robot fewer" in run.case else 5)
        for fault in run.scenario.faults:
            assert (fault.at or 0.0) < run.scenario.duration
