"""The workers that make the runs of a sweep: processes of this machine, or those of a Dask cluster.

Processes of our own rather than a pool of the standard library: there, one that dies fails every run that waits, a
run goes on when its parent is gone, and scripts that call `fogwatch.sweep` would need a `__main__` guard.
"""

from __future__ import annotations

import asyncio
import importlib
import json
import logging
import os
import selectors
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from numbers import Integral
from types import TracebackType
from typing import IO, Any, Protocol, Self

from experiments.sweeps.worker import Answer, Task, answer, prepare_worker, run_task, software
from patrol.errors import BadInput, quoted
from runtime.starting.environment import own_environment

LOOK_UP_S = 0.5
"""Interval of looking up while no worker answers, s: a signal that comes just before the wait does not end it."""

GRACE_S = 2.0
"""Longest wait for a worker that has closed its output to end by itself."""

TIMEOUT_S = 10.0
"""Longest wait for a Dask scheduler to answer, and for a first worker."""


class WorkerPool(Protocol):
    """Workers that make runs; a context manager that ends them."""

    size: int  # how many runs they make at a time

    def __enter__(self) -> Self:
        """Get ready. Raises BadInput if there are no workers."""
        ...

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """End the workers, in the middle of a run if need be."""
        ...

    def work(self, tasks: Sequence[Task]) -> Iterator[Answer]:
        """Make runs; yield the answer to each task as soon as there is one, in any order."""
        ...


class LocalWorkers:
    """Processes of this machine, each making one run at a time (`WorkerPool`).

    They share nothing with this process. If one dies, its run has failed and it is replaced. All of them end by
    themselves when this process dies.
    """

    def __init__(self, size: int | None = None) -> None:
        """Start no process yet; without `size` there is one for each core that this process may use."""
        if size is not None and not (isinstance(size, Integral) and size >= 1):
            raise BadInput(f"workers = {quoted(size)}: expected 1 or more")
        self.size = size or cores()
        self._workers: dict[IO[bytes], _Worker] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        while self._workers:
            _, worker = self._workers.popitem()
            worker.end()

    def work(self, tasks: Sequence[Task]) -> Iterator[Answer]:
        """Make runs; yield the answer to each task as soon as there is one, in any order."""
        waiting = deque(tasks)
        with selectors.DefaultSelector() as selector:
            for _ in range(min(self.size, len(waiting))):
                self._start_worker(selector, waiting.popleft())
            while self._workers:
                for ready, _ in selector.select(LOOK_UP_S):
                    assert not isinstance(ready.fileobj, int)
                    yield self._take_answer(selector, ready.fileobj, waiting)  # type: ignore[arg-type]

    def _start_worker(self, selector: selectors.BaseSelector, task: Task) -> None:
        worker = _Worker()
        self._workers[worker.answers] = worker
        selector.register(worker.answers, selectors.EVENT_READ)
        worker.give(task)

    def _take_answer(self, selector: selectors.BaseSelector, answers: IO[bytes], waiting: deque[Task]) -> Answer:
        """Take a worker's answer, or make one if it has died; then give it its next task, or end it."""
        worker = self._workers[answers]
        task, line = worker.task, answers.readline()
        died = not line.endswith(b"\n")
        if died or not waiting:
            selector.unregister(answers)
            del self._workers[answers]
            code = worker.end(died)
            if waiting:
                self._start_worker(selector, waiting.popleft())
        else:
            worker.give(waiting.popleft())
            code = 0
        if died:
            return answer(task, f"its worker process died ({_death_cause(code)})")
        result: Answer = json.loads(line)
        return result


def cores() -> int:
    """Return the number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _death_cause(code: int) -> str:
    """Return the end of a process in words, from its exit code."""
    if code == -signal.SIGKILL:
        return "killed; was there too little memory?"
    return signal.Signals(-code).name if code < 0 else f"exit code {code}"


class _Worker:
    """One worker process and its task."""

    def __init__(self) -> None:
        # In a group of its own: Ctrl-C on a terminal reaches this process alone, which then ends its workers.
        command = [sys.executable, "-P", "-m", "experiments.sweeps.worker"]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, process_group=0, env=own_environment())
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._tasks = self._process.stdin
        self.answers: IO[bytes] = self._process.stdout
        self.task: Task = {}

    def give(self, task: Task) -> None:
        """Send the next task; if the worker has died meanwhile, the end of its output shows that."""
        self.task = task
        with suppress(BrokenPipeError):
            self._tasks.write(json.dumps(task).encode() + b"\n")
            self._tasks.flush()

    def end(self, died: bool = False) -> int:
        """End the process, whatever it is doing; the exit code. One that is dying gets `GRACE_S` to end."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(GRACE_S if died else 0.0)
        self._process.kill()
        code = self._process.wait()
        for pipe in (self._tasks, self.answers):
            with suppress(BrokenPipeError):
                pipe.close()
        return code


class ClusterWorkers:
    """The workers of a Dask cluster (`WorkerPool`).

    Each worker needs the same version of fogwatch, and a scenario's map at the same path. Runs that are in progress
    when the sweep is interrupted go on to their end on the cluster; their results are lost.

    `size` is the number of threads of the workers, once the context is entered.
    """

    def __init__(self, address: str, timeout_s: float = TIMEOUT_S) -> None:
        """Connect to nothing yet; `address` is that of the scheduler, such as tcp://host:8786.

        `timeout_s` is how long to wait for it, and for a first worker.
        """
        self.size = 0
        self._address = address
        self._timeout_s = timeout_s
        self._client: Any = None

    def __enter__(self) -> Self:
        dask = _import_dask()
        logging.getLogger("distributed").setLevel(logging.CRITICAL)  # it logs tracebacks of connections that end
        try:
            # A client that finds no scheduler keeps trying while it is closed, so first check that one answers.
            with ThreadPoolExecutor(1) as aside:  # a notebook's own thread has an event loop already
                aside.submit(asyncio.run, _check_reachable(self._address, self._timeout_s)).result()
            self._client = dask.Client(self._address, timeout=self._timeout_s, set_as_default=False)
        except Exception as error:  # noqa: BLE001 - what answers there may not be Dask
            why = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise BadInput(
                f"cluster = {self._address}: cannot be reached ({why}); give the address of a running Dask "
                "scheduler, such as tcp://host:8786"
            ) from None
        try:
            self._check_workers(self._client)
        except BaseException:
            self._client.close()
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._client is not None:
            self._client.close()

    def work(self, tasks: Sequence[Task]) -> Iterator[Answer]:
        """Make runs; yield the answer to each task as soon as there is one, in any order."""
        futures = [self._client.submit(run_task, task, pure=False) for task in tasks]
        task_of = {future.key: task for future, task in zip(futures, tasks, strict=True)}
        for future in _import_dask().as_completed(futures, loop=self._client.loop):
            task = task_of[future.key]
            if future.status in ("cancelled", "lost"):
                raise BadInput(f"cluster = {self._address}: was lost; start again to make the remaining runs")
            error = future.exception()
            if error is not None:
                yield answer(task, f"its Dask worker failed: {type(error).__name__}: {error}")
                continue
            result: Answer = future.result()
            future.release()
            yield result

    def _check_workers(self, client: Any) -> None:
        """Check that there are workers and that they run this version."""
        try:
            client.wait_for_workers(1, timeout=self._timeout_s)
        except TimeoutError:
            raise BadInput(f"cluster = {self._address}: has no workers; start one with: dask worker ADDRESS") from None
        try:
            versions: dict[str, Any] = client.run(prepare_worker)
        except Exception as error:  # noqa: BLE001 - another machine may raise anything
            raise BadInput(
                f"cluster = {self._address}: its workers cannot run fogwatch ({type(error).__name__}: {error}); "
                "install it on each of them"
            ) from None
        for worker, version in sorted(versions.items()):
            if version != software():
                raise BadInput(
                    f"cluster = {self._address}: worker {worker} has fogwatch {version}, this is {software()}; "
                    "install the same on both"
                )
        self.size = sum(client.nthreads().values())


async def _check_reachable(address: str, timeout_s: float) -> None:
    """Raise an error unless a Dask scheduler, or something like one, answers at an address."""
    answering = await importlib.import_module("distributed.comm").connect(address, timeout=timeout_s)
    await answering.close()


def _import_dask() -> Any:
    """Import Dask's library, which is an optional dependency and has no types."""
    try:
        return importlib.import_module("distributed")
    except ImportError:
        raise BadInput("cluster: needs Dask; install it with: pip install 'fogwatch[experiments]'") from None
