"""One run of a sweep, wherever it is made: the same function for a local worker process and for a Dask worker.

Run as a program (``python -P -m experiments.sweeps.worker``) it takes tasks as JSON lines from its standard input and
answers
each with a JSON line, until the input ends: at once, even in the middle of a run, for then whoever asked is gone.
"""

from __future__ import annotations

import gc
import json
import os
import queue
import sys
import threading
import time
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

from patrol.errors import BadInput

Task = dict[str, Any]
"""key, case, seed: of the run; scenario: resolved, as plain lists, texts and numbers."""

Answer = dict[str, Any]
"""The fields of `experiments.sweeps.results.Result`."""

Metrics = dict[str, float | None]

PACKAGES = ("patrol", "agent", "worldsim")
"""Whose kernels a run needs."""


def software() -> str:
    """The version of this software."""
    return version("fogwatch")


def greet() -> str:
    """Make sure that this machine can run tasks: compile the kernels once; returns the version of the software."""
    from patrol.process.warmup import warm

    warm(PACKAGES, lambda _: None)
    return software()


def run_task(task: Task) -> Answer:
    """Make one run; a run that cannot be made or believed comes back as a failed one and raises nothing."""
    begun = time.perf_counter()
    metrics: Metrics = {}
    trace = error = None
    try:
        metrics, trace, error = _run(task["scenario"])
    except BadInput as problem:
        error = str(problem)
    except Exception as problem:  # noqa: BLE001 - one failed run must not end the others
        error = f"{type(problem).__name__}: {problem}"
    gc.collect()  # minds lie in reference cycles, few objects with large arrays: many runs would hold hundreds of MB
    return answer(task, error, metrics, trace, time.perf_counter() - begun)


def _run(scenario: Mapping[str, Any]) -> tuple[Metrics, str, str | None]:
    """A run's metrics, its trace hash, and why it is not to be believed, if it is not."""
    from experiments.inprocess import run_in_process
    from experiments.sweeps.belief_error import (
        BeliefError,  # here: loads the kernels, which `greet` may have to compile
    )
    from patrol.scenario import load_scenario

    # Nothing comes between this process's world and its own verdict: no need to compute each run's fog twice.
    belief = BeliefError()
    outcome = run_in_process(load_scenario(scenario), keep=False, verify_fog=False, look=belief.look)
    doubts = "; ".join(f"{check.name}: {check.detail}" for check in outcome.verdict.failed)
    error = None if outcome.verdict.valid else f"not valid: {doubts}"
    return {**metrics_of(outcome.summary), **belief.metrics()}, outcome.summary["trace_hash"], error


def answer(
    task: Task,
    error: str | None,
    metrics: Mapping[str, float | None] | None = None,
    trace: str | None = None,
    wall_s: float = 0.0,
) -> Answer:
    """The answer to a task."""
    return {
        "key": task["key"],
        "case": task["case"],
        "seed": task["seed"],
        "outcome": "ok" if error is None else "failed",
        "error": None if error is None else " ".join(error.split()),
        "metrics": dict(metrics or {}),
        "trace_hash": trace,
        "wall_s": wall_s,
        "software": software(),
    }


def metrics_of(summary: Mapping[str, Any]) -> dict[str, float | None]:
    """The numbers of a summary that depend on the scenario alone; of robots their sum, or mean or most by its name."""
    robots = list(summary["robots"].values())
    plain = (
        "mfow_mean_s",
        "mfow_max_s",
        "mfow_late_mean_s",
        "mfow_end_s",
        "fog_mean_s",
        "seen_share",
        "bound_s",
        "patrolled_area_m2",
    )
    messages = ("frames", "sent", "delivered", "dropped", "rejected", "bytes_per_robot_s")
    return {
        **{name: summary[name] for name in plain},
        "dead_end_percent": 100.0 * sum(robot["dead_end_share"] for robot in robots) / len(robots),
        "collisions": sum(robot["collisions"] for robot in robots),
        "longest_stay_s": max(robot["longest_stay_s"] for robot in robots),
        "distance_m": sum(robot["distance_m"] for robot in robots),
        **{f"messages_{name}": summary["messages"][name] for name in messages},
    }


def main() -> None:
    """Answer tasks until the input ends."""
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # whatever else is printed must not get between the answers
    tasks: queue.SimpleQueue[Task] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(tasks,), daemon=True).start()
    while True:
        print(json.dumps(run_task(tasks.get()), allow_nan=False), file=out, flush=True)


def _read(tasks: queue.SimpleQueue[Task]) -> None:
    for line in sys.stdin:
        tasks.put(json.loads(line))
    os._exit(0)


if __name__ == "__main__":
    main()
