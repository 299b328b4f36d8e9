"""Running many: a plan's runs on a crew of workers, each result on disk as it comes, and no run made twice."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from experiments.sweeps.plan import Plan, Run
from experiments.sweeps.pool import LocalWorkers, WorkerPool
from experiments.sweeps.results import Results, RunResult, open_results
from experiments.sweeps.worker import PACKAGES, Task, software
from patrol.scenario import as_mapping


@dataclass(frozen=True, slots=True)
class SweepOutcome:
    """What a plan's runs came to.

    results: by key. made: how many runs this sweep made; the others were there. wall_s: how long that took.
    """

    plan: Plan
    results: Mapping[str, RunResult]
    made: int
    wall_s: float

    @property
    def failed(self) -> list[RunResult]:
        """The runs that have no numbers to believe, each once."""
        return [result for result in self._distinct() if not result.ok]

    @property
    def other_software(self) -> list[str]:
        """Other versions of this software that made some of the runs."""
        return sorted({result.software for result in self._distinct()} - {software()})

    def _distinct(self) -> list[RunResult]:
        return [self.results[key] for key in dict.fromkeys(run.key for run in self.plan.runs) if key in self.results]

    def values(self, case: str, metric: str) -> dict[int, float]:
        """A metric of a case by seed, of the runs that have one."""
        found = {}
        for run in self.plan.runs_of(case):
            result = self.results.get(run.key)
            value = result.metrics.get(metric) if result is not None and result.ok else None
            if value is not None:
                found[run.seed] = value
        return found


class SweepObserver(Protocol):
    """Somebody who looks on."""

    def begin(self, todo: list[Run], done: list[RunResult], workers: int) -> None:
        """The runs still to be made, and the results that were there."""
        ...

    def result(self, result: RunResult) -> None:
        """One more run is done, and on disk."""
        ...


def run_sweep(
    plan: Plan,
    folder: Path,
    *,
    workers: WorkerPool | None = None,
    observer: SweepObserver | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> SweepOutcome:
    """Make those of a plan's runs that have no result in `folder` yet; a run that failed before is tried again.

    workers: who works; a process for each core unless given. say: takes remarks on what takes time. BadInput before the
    first run when the folder, its results or the crew cannot be used. Ending this call early, by an exception such as
    KeyboardInterrupt or by SIGKILL, loses the runs at work alone: the same call goes on where it stopped.
    """
    begun = time.perf_counter()
    with open_results(folder) as results:
        if results.repaired:
            say(f"{results.path}: the last line was cut off in the middle; it is mended")
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
    from patrol.process.warmup import warm

    warm(PACKAGES, say)
    with workers:
        if observer is not None:
            observer.begin(todo, done, min(workers.size, len(todo)))
        for found in workers.work([_task(run) for run in todo]):
            result = RunResult(**found)
            results.add(result)
            if observer is not None:
                observer.result(result)


def _task(run: Run) -> Task:
    return {"key": run.key, "case": run.case, "seed": run.seed, "scenario": as_mapping(run.scenario)}
