"""Outcomes of sweeps, as if every run had come to numbers that depend on its case and seed."""

from collections.abc import Callable, Mapping

from experiments.sweeps.plan import Plan
from experiments.sweeps.results import RunResult
from experiments.sweeps.runner import SweepOutcome


def outcome_of(plan: Plan, metrics: Callable[[str, int], Mapping[str, float]]) -> SweepOutcome:
    results = {
        run.key: RunResult(run.key, run.case, run.seed, "ok", None, metrics(run.case, run.seed), None, 2.0, "1")
        for run in plan.runs
    }
    return SweepOutcome(plan, results, len(results), 1.0)
