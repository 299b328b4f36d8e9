"""One run of a sweep: the same function for a local worker process and for a Dask worker.

As a program (``python -P -m experiments.sweeps.worker``) it reads tasks as JSON lines from the standard input and
answers each with a JSON line. It ends when the input ends, even in the middle of a run, since its parent is gone then.
"""

from __future__ import annotations

import gc
import importlib
import json
import os
import queue
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from experiments.sweeps.results import FAILED, OK
from patrol.classes.exits import end_now
from patrol.errors import BadInput
from patrol.summary.metric import metrics_of as declared
from patrol.summary.model import Messages, NodeFigures, RobotFigures, Summary, VerdictFacts

if TYPE_CHECKING:
    from pydantic import BaseModel

    from fogwatch.inprocess import Outcome
    from patrol.prepare import Prepared
    from patrol.scenario import Scenario

Task = dict[str, Any]
"""A run to make: its key, case, seed, scenario (resolved, as plain lists, texts and numbers), and under `games` whether
intruder games are played on it."""

Answer = dict[str, Any]
"""The fields of `experiments.sweeps.results.RunResult`, but for its settings."""

Metrics = dict[str, float | None]

PACKAGES = ("patrol", "agent", "worldsim")
"""The packages whose kernels a run needs."""


def software() -> str:
    """Return the version of fogwatch."""
    return version("fogwatch")


def prepare_worker() -> str:
    """Compile the kernels, so that this machine can run tasks, and return the version of fogwatch."""
    from runtime.starting.warmup import SELDOM, warm

    warm(PACKAGES, lambda _: None, SELDOM)
    return software()


def run_task(task: Task) -> Answer:
    """Make one run; one that raises an error or has no valid verdict is answered as failed."""
    # Of this thread, in which the whole run takes place: a Dask worker makes other runs in other threads.
    begun, used = time.perf_counter(), time.thread_time()
    metrics: Metrics = {}
    trace = error = None
    try:
        metrics, trace, error = _run_scenario(task["scenario"], task.get("games", False))
    except BadInput as problem:
        error = str(problem)
    except Exception as problem:  # noqa: BLE001 - one failed run must not end the others
        error = f"{type(problem).__name__}: {problem}"
    gc.collect()  # minds are few objects with large arrays, in reference cycles: many runs would hold hundreds of MB
    return answer(task, error, metrics, trace, time.perf_counter() - begun, time.thread_time() - used)


def _run_scenario(scenario: Mapping[str, Any], games: bool) -> tuple[Metrics, str | None, str | None]:
    """Return a run's metrics, its trace hash, and the failed checks of its verdict, or None if it is valid."""
    from patrol.scenario import load_scenario

    outcome, observed = run_scenario(load_scenario(scenario), games)
    doubts = "; ".join(f"{check.name}: {check.detail}" for check in outcome.verdict.failed)
    error = None if outcome.verdict.valid else f"not valid: {doubts}"
    return {**metrics_of(outcome.summary), **observed}, outcome.summary.trace_hash, error


def run_scenario(scenario: Scenario | Prepared, games: bool = False) -> tuple[Outcome, Metrics]:
    """Run a scenario as every run of a sweep, with nothing written to disk.

    The metrics are those that the summary lacks: of the robots' beliefs and, with `games`, of intruder games.
    """
    from experiments.sweeps.run_metrics import BeliefError, GameLog
    from fogwatch.inprocess import run_in_process  # here: it loads kernels that `prepare_worker` compiles

    # The world and the verdict are in one process, so the verdict need not compute the fog a second time.
    belief, log = BeliefError(), GameLog() if games else None
    watch = None if log is None else log.watch
    outcome = run_in_process(scenario, keep=False, verify_fog=False, look=belief.look, watch=watch)
    return outcome, {**belief.metrics(), **(log.metrics() if log is not None else {})}


def answer(
    task: Task,
    error: str | None,
    metrics: Mapping[str, float | None] | None = None,
    trace: str | None = None,
    wall_s: float = 0.0,
    processor_s: float = 0.0,
) -> Answer:
    """Return the answer to a task; `error` is why the run failed, None if it did not.

    `processor_s` is without the processor time of other runs in the same process.
    """
    return {
        "key": task["key"],
        "case": task["case"],
        "seed": task["seed"],
        "outcome": OK if error is None else FAILED,
        "error": None if error is None else " ".join(error.split()),
        "metrics": dict(metrics or {}),
        "trace_hash": trace,
        "wall_s": wall_s,
        "processor_s": processor_s,
        "software": software(),
    }


def metrics_of(summary: Summary) -> Metrics:
    """Return the metrics that are declared with a column, by the names of their columns.

    They depend on the scenario alone, not on the machine. Those of single robots are reduced as declared.
    """
    parts: list[tuple[type[BaseModel], str, Sequence[BaseModel]]] = [
        (Summary, "", [summary]),
        (RobotFigures, "", list(summary.robots.values())),
        (VerdictFacts, "", [summary.verdict] if summary.verdict else []),
        (Messages, "messages_", [summary.messages]),
        (NodeFigures, "nodes_", [summary.nodes] if summary.nodes else []),
    ]
    return {
        f"{prefix}{metric.column or key}": metric.reduced([getattr(value, key) for value in values])
        for model, prefix, values in parts
        for key, metric in declared(model)
        if metric.sweep and values
    }


def main() -> None:
    """Answer tasks until the input ends."""
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # other output must not mix with the answers
    tasks: queue.SimpleQueue[Task] = queue.SimpleQueue()
    threading.Thread(target=_read_tasks, args=(tasks,), daemon=True).start()
    importlib.import_module("fogwatch.inprocess")
    gc.freeze()  # libraries hold many objects, which collecting after each run would look through again
    while True:
        print(json.dumps(run_task(tasks.get()), allow_nan=False), file=out, flush=True)


def _read_tasks(tasks: queue.SimpleQueue[Task]) -> None:
    for line in sys.stdin:
        tasks.put(json.loads(line))
    end_now(0)


if __name__ == "__main__":
    main()
