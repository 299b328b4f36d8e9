"""Sweeps that run: the same numbers whoever makes the runs, and no run made twice."""

from __future__ import annotations

import csv
import gc
import io
import json
import selectors
import signal
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import pytest

from agent.mind import Mind
from experiments.sweeps.cases import case_rows, write_tables
from experiments.sweeps.plan import Base, Case, Plan, Run, make_plan
from experiments.sweeps.results import RunResult, open_results
from experiments.sweeps.run_metrics import BeliefError
from experiments.sweeps.runner import run_sweep
from experiments.sweeps.stats import estimate
from experiments.sweeps.worker import Answer, Task, metrics_of, run_scenario, run_task
from experiments.sweeps.workers import ClusterWorkers, LocalWorkers
from fogwatch.inprocess import Outcome, run_in_process
from patrol.errors import BadInput
from patrol.scenario import Scenario, load_scenario
from tests.present import present
from worldsim.world import World

ROBOTS, PATROL = {"count": 2, "model": "holonomic"}, {"policy": "potential-field"}
BASE = {"terrain": {"builtin": "open"}, "point": 1, "duration": 30, "robots": ROBOTS, "patrol": PATROL}


def plan(cases: Mapping[str, Mapping[str, object]], seeds: Sequence[int] = (1, 2), **more: Any) -> Plan:
    base = Base({**BASE, **more}, Path(), "trial")
    return make_plan("trial", base, [Case(name, settings) for name, settings in cases.items()], seeds)


SIX = {f"mode {count}": {"patrol.options.direction": "mode", "robots.count": count} for count in (1, 2, 3)}
TASK = {"key": "k", "case": "c", "seed": 1, "scenario": BASE}
OVERLAP: dict[str, object] = {"robots.starts": [[3, 3], [3.5, 3]]}


class Here:
    """A crew of one, in this process."""

    size = 1

    def __init__(self) -> None:
        self.made: list[tuple[str, int]] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """Nobody to let go."""

    def work(self, tasks: Sequence[Task]) -> Iterator[Answer]:
        for task in tasks:
            self.made.append((task["case"], task["seed"]))
            yield run_task(json.loads(json.dumps(task)))


class Watching:
    """Counts, and gives up after so many results."""

    def __init__(self, most: int = 1000) -> None:
        self.results: list[RunResult] = []
        self.found: list[RunResult] = []
        self._most = most

    def begin(self, todo: list[Run], done: list[RunResult], workers: int) -> None:
        assert workers <= len(todo)
        self.found = done

    def result(self, result: RunResult) -> None:
        self.results.append(result)
        if len(self.results) == self._most:
            raise KeyboardInterrupt


def numbers(results: Mapping[str, RunResult]) -> dict[str, Any]:
    """The facts that must not depend on which process made a run."""
    return {key: (result.outcome, result.metrics, result.trace_hash) for key, result in results.items()}


@pytest.fixture(scope="module")
def reference() -> dict[str, Any]:
    """The numbers of SIX, each run by itself."""
    found = {}
    for run in plan(SIX).runs:
        belief = BeliefError()
        summary = run_in_process(run.scenario, look=belief.look).summary
        found[run.key] = ("ok", {**metrics_of(summary), **belief.metrics()}, summary.trace_hash)
    return found


@pytest.mark.processes
def test_two_worker_processes_give_the_numbers_of_each_run_by_itself(tmp_path: Path, reference: dict[str, Any]) -> None:
    outcome = run_sweep(plan(SIX), tmp_path, workers=LocalWorkers(2))
    assert numbers(outcome.results) == reference
    assert outcome.made == 6
    with open_results(tmp_path) as there:
        assert numbers(there.by_key) == reference


@pytest.mark.processes
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning")
def test_a_cluster_of_two_workers_gives_the_same_numbers(tmp_path: Path, reference: dict[str, Any]) -> None:
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster:  # type: ignore[no-untyped-call]
        workers = ClusterWorkers(cluster.scheduler_address)
        outcome = run_sweep(plan(SIX), tmp_path, workers=workers)
        assert workers.size == 2
    assert numbers(outcome.results) == reference


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense", "http://x:1"])
def test_a_cluster_that_cannot_be_reached_is_said_before_anything_runs(tmp_path: Path, address: str) -> None:
    with pytest.raises(BadInput, match=r"^cluster = .*: cannot be reached"):
        run_sweep(plan(SIX), tmp_path, workers=ClusterWorkers(address, timeout_s=0.5))
    with open_results(tmp_path) as there:
        assert there.by_key == {}


def test_an_interrupted_sweep_goes_on_where_it_stopped(tmp_path: Path, reference: dict[str, Any]) -> None:
    with pytest.raises(KeyboardInterrupt):
        run_sweep(plan(SIX), tmp_path, workers=Here(), observer=Watching(most=2))
    workers, watching = Here(), Watching()
    outcome = run_sweep(plan(SIX), tmp_path, workers=workers, observer=watching)
    assert workers.made == [("mode 2", 1), ("mode 2", 2), ("mode 3", 1), ("mode 3", 2)]
    assert [result.case for result in watching.found] == ["mode 1", "mode 1"]
    assert numbers(outcome.results) == reference
    assert run_sweep(plan(SIX), tmp_path, workers=Here()).made == 0


def test_a_sweep_can_grow_and_cases_share_what_means_the_same(tmp_path: Path) -> None:
    workers = Here()
    run_sweep(plan({"a": {}}), tmp_path, workers=workers)
    grown = plan({"a": {}, "same": {"robots.count": 2}, "other": {"robots.count": 1}}, seeds=(1, 2, 3))
    outcome = run_sweep(grown, tmp_path, workers=workers)
    assert workers.made == [("a", 1), ("a", 2), ("a", 3), ("other", 1), ("other", 2), ("other", 3)]
    assert outcome.values("a", "mfow_mean_s") == outcome.values("same", "mfow_mean_s")
    assert outcome.values("other", "mfow_mean_s").keys() == {1, 2, 3}


def test_other_runs_in_the_folder_do_not_count_as_this_plan_s(tmp_path: Path) -> None:
    other = run_sweep(plan({"other": {"robots.count": 1}}), tmp_path, workers=Here())
    outcome = run_sweep(plan({"a": {}, "same": {"robots.count": 2}}), tmp_path, workers=Here())
    assert len(outcome.results) == 4
    own = {key: result for key, result in outcome.results.items() if key not in other.results}
    assert len(own) == 2  # which both cases share
    assert outcome.computing_s == pytest.approx(sum(result.computing_s for result in own.values()))
    assert other.computing_s == pytest.approx(sum(result.computing_s for result in other.results.values()))


def test_a_run_that_fails_costs_no_other_and_is_tried_again(tmp_path: Path) -> None:
    cases: dict[str, dict[str, object]] = {"good": {}, "bad": OVERLAP}
    outcome = run_sweep(plan(cases), tmp_path, workers=Here())
    assert [(run.case, run.seed) for run in outcome.failed] == [("bad", 1), ("bad", 2)]
    assert all(run.error and "overlap" in run.error for run in outcome.failed)
    good, bad = case_rows(outcome)
    assert (good.runs, good.failed, bad.runs, bad.failed, bad.metrics) == (2, 0, 0, 2, {})
    workers = Here()
    run_sweep(plan(cases), tmp_path, workers=workers)
    assert workers.made == [("bad", 1), ("bad", 2)]


def test_whatever_a_run_raises_is_its_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: Any, **__: Any) -> None:
        raise RuntimeError("no\nidea")

    monkeypatch.setattr("fogwatch.inprocess.run_in_process", broken)
    found = run_task(TASK)
    assert (found["outcome"], found["error"], found["metrics"]) == ("failed", "RuntimeError: no idea", {})


def test_a_run_is_not_charged_with_what_another_thread_computes(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a Dask worker with several threads."""
    waiting, computed = threading.Event(), threading.Event()

    done = run_scenario(load_scenario(BASE))

    def run(scenario: Scenario, games: bool) -> tuple[Outcome, Mapping[str, float | None]]:
        assert not games
        if scenario.seed == 1:  # the idle one
            waiting.set()
            assert computed.wait(300.0)
        else:
            assert waiting.wait(300.0)
            begun = time.thread_time()
            while time.thread_time() - begun < 0.3:
                pass
            computed.set()
        return done

    monkeypatch.setattr("experiments.sweeps.worker.run_scenario", run)
    monkeypatch.setattr(gc, "collect", lambda: 0)
    tasks = [{**TASK, "scenario": {**BASE, "seed": seed}} for seed in (1, 2)]
    with ThreadPoolExecutor(2) as threads:
        idle, busy = threads.map(run_task, tasks)
    assert (idle["outcome"], busy["outcome"]) == ("ok", "ok")
    assert busy["processor_s"] >= 0.3 > idle["processor_s"]
    assert idle["wall_s"] >= 0.3


def test_a_run_leaves_nothing_behind_in_its_worker(monkeypatch: pytest.MonkeyPatch) -> None:
    """Or a long sweep would grow without end."""
    minds: list[weakref.ref[Mind]] = []

    def noting(scenario: Scenario, look: Callable[[World, Mapping[int, Mind]], None], **how: Any) -> Outcome:
        def both(world: World, now: Mapping[int, Mind]) -> None:
            minds.extend(weakref.ref(mind) for mind in now.values())
            look(world, now)

        return run_in_process(scenario, look=both, **how)

    monkeypatch.setattr("fogwatch.inprocess.run_in_process", noting)
    gc.disable()
    try:
        assert run_task(TASK)["outcome"] == "ok"
        assert minds
        assert all(mind() is None for mind in minds)
    finally:
        gc.enable()


@pytest.mark.processes
def test_a_worker_that_dies_fails_its_run_and_is_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    long = plan({"long": {"duration": 100_000}, "short": {}, "brief": {"duration": 20}}, seeds=(1,))
    started: list[subprocess.Popen[bytes]] = []
    start = subprocess.Popen

    def noted(*words: Any, **how: Any) -> subprocess.Popen[bytes]:
        started.append(start(*words, **how))
        return started[-1]

    monkeypatch.setattr(subprocess, "Popen", noted)

    class Killing(Watching):
        def result(self, result: RunResult) -> None:
            super().result(result)
            started[0].kill()  # it has the first run, the long one

    outcome = run_sweep(long, tmp_path, workers=LocalWorkers(2), observer=Killing())
    (failed,) = outcome.failed
    assert failed.case == "long"
    assert failed.error == "its worker process died (killed; was there too little memory?)"
    assert {result.case for result in outcome.results.values() if result.ok} == {"short", "brief"}


@pytest.mark.parametrize("size", [0, -1])
def test_workers_are_one_or_more(size: int) -> None:
    with pytest.raises(BadInput, match=f"^workers = {size}: expected 1 or more"):
        LocalWorkers(size)


def test_the_tables_hold_means_intervals_and_failures(tmp_path: Path) -> None:
    cases = plan({"a": {"sensor.range": 10, "robots.starts": "random"}, "bad": OVERLAP}, seeds=(1, 2, 3))
    outcome = run_sweep(cases, tmp_path, workers=Here())
    write_tables(outcome, tmp_path)
    row, bad = csv.DictReader(io.StringIO((tmp_path / "summary.csv").read_text()))
    runs = list(csv.DictReader(io.StringIO((tmp_path / "runs.csv").read_text())))
    assert [run["case"] + run["seed"] for run in runs] == ["a1", "a2", "a3", "bad1", "bad2", "bad3"]
    values = [float(run["fog_mean_s"]) for run in runs[:3]]
    assert float(row["fog_mean_s"]) == pytest.approx(sum(values) / 3)
    assert float(row["fog_mean_s_low"]) < min(values) < max(values) < float(row["fog_mean_s_high"])
    assert (bad["runs"], bad["failed"], row["warned"], bad["warned"]) == ("0", "3", "0", "0")
    assert all("overlap" in run["error"] for run in runs[3:])
    header, first, second = (tmp_path / "summary.csv").read_text().splitlines()
    columns = "case,sensor.range,robots.starts,runs,failed,warned,mfow_mean_s,mfow_mean_s_low,mfow_mean_s_high,"
    assert header.startswith(columns)
    assert first.startswith("a,10,random,3,0,0,")
    assert second.startswith('bad,,"[[3, 3], [3.5, 3]]",0,3,0,,')


def test_a_change_is_that_of_the_means_with_the_interval_of_the_differences(tmp_path: Path) -> None:
    base = Base(BASE, Path(), "trial")
    cases = [Case(f"count {count}", {"robots.count": count}) for count in (1, 2)]
    outcome = run_sweep(make_plan("trial", base, cases, (1, 2, 3), {"robots.count": 1}), tmp_path, workers=Here())
    one, two = case_rows(outcome)
    assert (one.against, one.change) == (None, {})
    assert two.against == "count 1"
    ours, theirs = two.values["fog_mean_s"], one.values["fog_mean_s"]
    change = two.change["fog_mean_s"]
    assert change.mean == pytest.approx(100.0 * (two.metrics["fog_mean_s"].mean / one.metrics["fog_mean_s"].mean - 1.0))
    differences = estimate([ours[seed] - theirs[seed] for seed in (1, 2, 3)])
    assert change.half == pytest.approx(100.0 * (differences.half or 0.0) / one.metrics["fog_mean_s"].mean)
    write_tables(outcome, tmp_path)
    header, first, second = (line.split(",") for line in (tmp_path / "summary.csv").read_text().splitlines())
    assert second[-1] == "count 1"
    assert len(header) == len(first) == len(second)
    assert dict(zip(header, second, strict=True))["fog_mean_s_change_percent"] == str(change.mean)


@pytest.mark.processes
def test_a_signal_that_does_not_wake_the_wait_ends_it() -> None:
    """So it is with Ctrl-C that comes just before the wait begins; here another thread takes the signal."""
    waiting = present(threading.main_thread().ident)
    over = threading.Event()

    def interrupt() -> None:
        while sys._current_frames()[waiting].f_code.co_filename != selectors.__file__:
            if over.wait(0.01):
                return
        signal.pthread_kill(threading.get_ident(), signal.SIGINT)

    thread = threading.Thread(target=interrupt, daemon=True)
    thread.start()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        with pytest.raises(KeyboardInterrupt), LocalWorkers(1) as workers:
            next(workers.work([{**TASK, "scenario": {**BASE, "duration": 1_000_000}}]))
    finally:
        over.set()
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        thread.join()
