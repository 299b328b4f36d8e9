"""Making the runs of a plan: on workers, each result on disk as soon as it is there, and no run made twice."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from experiments.sweeps.plan import Plan, Run
from experiments.sweeps.pool import LocalWorkers, WorkerPool
from experiments.sweeps.results import Results, RunResult, open_results
from experiments.sweeps.stats import check_installed
from experiments.sweeps.worker import PACKAGES, Task, software
from patrol.scenario import as_mapping


@dataclass(frozen=True, slots=True)
class SweepOutcome:
    """The results of a plan's runs.

    Attributes:
        plan: The plan.
        results: The results by the keys of their runs, with those of other plans that are in the same folder.
        made: Number of runs made now; the other results were there.
        wall_s: How long that took, s.
    """

    plan: Plan
    results: Mapping[str, RunResult]
    made: int
    wall_s: float

    @property
    def failed(self) -> list[RunResult]:
        """The results of the runs that failed, each once."""
        return [result for result in self._distinct() if not result.ok]

    @property
    def other_software(self) -> list[str]:
        """The other versions of fogwatch that made some of the runs."""
        return sorted({result.software for result in self._distinct()} - {software()})

    @property
    def computing_s(self) -> float:
        """Processor time of the plan's runs, each once, s; for results without it, of older versions, the wall time."""
        return sum(result.computing_s for result in self._distinct())

    def _distinct(self) -> list[RunResult]:
        return [self.results[key] for key in dict.fromkeys(run.key for run in self.plan.runs) if key in self.results]

    def values(self, case: str, metric: str) -> dict[int, float]:
        """Return the values of a metric.

        Args:
            case: Name of a case.
            metric: Name of a metric.

        Returns:
            The values by seed, of the valid runs of the case that have the metric.
        """
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
        """The sweep begins.

        Args:
            todo: The runs to make.
            done: The results that were there.
            workers: How many runs are made at a time.
        """
        ...

    def result(self, result: RunResult) -> None:
        """One more run is done, and its result on disk.

        Args:
            result: The result.
        """
        ...


def run_sweep(
    plan: Plan,
    folder: Path,
    *,
    workers: WorkerPool | None = None,
    observer: SweepObserver | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> SweepOutcome:
    """Make the runs of a plan that have no valid result in a folder yet.

    Ending this call early, by an exception such as KeyboardInterrupt or by SIGKILL, loses only the runs in progress:
    the same call continues where it stopped.

    Args:
        plan: The runs.
        folder: Where the results are kept.
        workers: The workers; a process per core unless given.
        observer: Informed about the progress.
        say: Takes lines for the user.

    Returns:
        The results, old and new.

    Raises:
        BadInput: The folder, its results or the workers cannot be used, or scipy is not installed.
    """
    check_installed()
    begun = time.perf_counter()
    with open_results(folder) as results:
        if results.repaired:
            say(f"{results.path}: the last line was incomplete and has been repaired")
        distinct: dict[str, Run] = {}
        for run in plan.runs:
            distinct.setdefault(run.key, run)
        done = [result for key in distinct if (result := results.by_key.get(key)) is not None and result.ok]
        there = {result.key for result in done}
        todo = [run for run in distinct.values() if run.key not in there]
        if todo:
            _make(todo, done, results, workers or LocalWorkers(), observer, say)
        return SweepOutcome(plan, dict(results.by_key), len(todo), time.perf_counter() - begun)


def _make(
    todo: list[Run],
    done: list[RunResult],
    results: Results,
    workers: WorkerPool,
    observer: SweepObserver | None,
    say: Callable[[str], None],
) -> None:
    from patrol.process.starting.seldom import SELDOM
    from patrol.process.starting.warmup import warm

    warm(PACKAGES, say, SELDOM)
    settings = {run.key: dict(run.settings) for run in todo}
    with workers:
        if observer is not None:
            observer.begin(todo, done, min(workers.size, len(todo)))
        for answer in workers.work([_task(run) for run in todo]):
            result = RunResult(**answer, settings=settings[answer["key"]])
            results.add(result)
            if observer is not None:
                observer.result(result)


def _task(run: Run) -> Task:
    scenario = as_mapping(run.scenario)
    return {"key": run.key, "case": run.case, "seed": run.seed, "scenario": scenario, "games": run.games}
