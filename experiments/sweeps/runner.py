"""Making the runs of a plan: on workers, each result on disk as soon as it is there, and no run made twice."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from experiments.sweeps.plan import Plan, Run
from experiments.sweeps.results import Results, RunResult, open_results
from experiments.sweeps.stats import check_installed
from experiments.sweeps.worker import PACKAGES, Task, software
from experiments.sweeps.workers import LocalWorkers, WorkerPool
from patrol.scenario import as_mapping


@dataclass(frozen=True, slots=True)
class SweepOutcome:
    """The results of a plan's runs."""

    plan: Plan
    results: Mapping[str, RunResult]  # by the keys of their runs, with those of other plans in the same folder
    made: int  # number of runs made now; the other results were there
    wall_s: float  # how long that took

    @property
    def failed(self) -> list[RunResult]:
        """The results of the runs that failed, each once."""
        return [result for result in self._distinct_results() if not result.ok]

    @property
    def other_software(self) -> list[str]:
        """The other versions of fogwatch that made some of the runs."""
        return sorted({result.software for result in self._distinct_results()} - {software()})

    @property
    def computing_s(self) -> float:
        """Processor time of the plan's runs, each once, s; for results without it, of older versions, the wall time."""
        return sum(result.computing_s for result in self._distinct_results())

    def _distinct_results(self) -> list[RunResult]:
        return [self.results[key] for key in dict.fromkeys(run.key for run in self.plan.runs) if key in self.results]

    def values(self, case: str, metric: str) -> dict[int, float]:
        """Return the values of a metric by seed, of the valid runs of a case that have it."""
        by_seed = {}
        for run in self.plan.runs_of(case):
            result = self.results.get(run.key)
            value = result.metrics.get(metric) if result is not None and result.ok else None
            if value is not None:
                by_seed[run.seed] = value
        return by_seed


class SweepObserver(Protocol):
    """Is informed about the progress of a sweep."""

    def begin(self, todo: list[Run], done: list[RunResult], workers: int) -> None:
        """Take the runs to make, `workers` at a time, and the results that were there, as the sweep begins."""
        ...

    def result(self, result: RunResult) -> None:
        """Take the result of one more run, which is on disk."""
        ...


def run_sweep(
    plan: Plan,
    folder: Path,
    *,
    workers: WorkerPool | None = None,
    observer: SweepObserver | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> SweepOutcome:
    """Make the runs of a plan that have no valid result in a folder yet, and return all results, old and new.

    Ending this call early, by an exception such as KeyboardInterrupt or by SIGKILL, loses only the runs in progress:
    the same call continues where it stopped.

    Unless `workers` are given, there is a process for each core. `say` takes lines for the user.
    """
    check_installed()
    begun = time.perf_counter()
    with open_results(folder) as results:
        if results.repaired:
            say(f"{results.path}: the last line was incomplete and has been repaired")
        distinct: dict[str, Run] = {}
        for run in plan.runs:
            distinct.setdefault(run.key, run)
        finished = [result for key in distinct if (result := results.by_key.get(key)) is not None and result.ok]
        keys = {result.key for result in finished}
        todo = [run for run in distinct.values() if run.key not in keys]
        if todo:
            _make_runs(todo, finished, results, workers or LocalWorkers(), observer, say)
        return SweepOutcome(plan, dict(results.by_key), len(todo), time.perf_counter() - begun)


def _make_runs(
    todo: list[Run],
    done: list[RunResult],
    results: Results,
    workers: WorkerPool,
    observer: SweepObserver | None,
    say: Callable[[str], None],
) -> None:
    from runtime.starting.warmup import SELDOM, warm

    warm(PACKAGES, say, SELDOM)
    settings = {run.key: dict(run.settings) for run in todo}
    tasks: list[Task] = [
        {"key": run.key, "case": run.case, "seed": run.seed, "scenario": as_mapping(run.scenario), "games": run.games}
        for run in todo
    ]
    with workers:
        if observer is not None:
            observer.begin(todo, done, min(workers.size, len(todo)))
        for answer in workers.work(tasks):
            result = RunResult(**answer, settings=settings[answer["key"]])
            results.add(result)
            if observer is not None:
                observer.result(result)
