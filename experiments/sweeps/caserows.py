"""The results of a sweep case by case."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from experiments.sweeps.plan import Label
from experiments.sweeps.runner import SweepOutcome
from experiments.sweeps.stats import Estimate, estimate


@dataclass(frozen=True, slots=True)
class CaseRow:
    """The results of one case."""

    case: str
    settings: Mapping[str, object]  # of the base scenario, by dotted field
    runs: int  # number of its valid runs
    failed: int
    warned: int  # number of its runs whose verdict has warnings
    metrics: Mapping[str, Estimate]  # mean of each over the seeds
    values: Mapping[str, Mapping[int, float]]  # of each metric, by seed
    against: str | None  # case that it is compared with; None for none
    # by how many percent each metric's mean is above that case's, with the interval of the differences seed by seed
    change: Mapping[str, Estimate]
    labels: tuple[Label, ...] = ()  # its values by axis, in the order of its name

    @property
    def words(self) -> list[str]:
        """The words of the case's name: one for each axis, or those of the name where there are no axes."""
        return [label.word for label in self.labels] or self.case.split()


def case_rows(outcome: SweepOutcome) -> list[CaseRow]:
    """Return the results of a sweep, one row per case in the plan's order.

    Metrics that no run has are left out.
    """
    names = dict.fromkeys(name for result in outcome.results.values() if result.ok for name in result.metrics)
    rows = []
    for case in outcome.plan.cases:
        other = outcome.plan.partner(case)
        runs = [outcome.results[run.key] for run in outcome.plan.runs_of(case.name) if run.key in outcome.results]
        good = sum(result.ok for result in runs)
        values = {name: own for name in names if (own := outcome.values(case.name, name))}
        metrics = {name: estimate(list(own.values())) for name, own in values.items()}
        change = {
            name: difference
            for name, own in values.items()
            if other is not None and (difference := _change(own, outcome.values(other.name, name))) is not None
        }
        named = other.name if other is not None else None
        warned = sum(value > 0.0 for value in values.get("warnings", {}).values())
        counts = (good, len(runs) - good, warned)
        rows.append(CaseRow(case.name, case.settings, *counts, metrics, values, named, change, case.labels))
    return rows


def _change(own: Mapping[int, float], others: Mapping[int, float]) -> Estimate | None:
    """Return by how many percent the mean over the seeds that both have is above the other's."""
    seeds = [seed for seed in own if seed in others]
    base = sum(others[seed] for seed in seeds) / max(len(seeds), 1)
    return estimate([100.0 * (own[seed] - others[seed]) / base for seed in seeds]) if base > 0.0 else None
