"""The workers that make the runs of a sweep: processes of this machine, or those of a Dask cluster.

Processes of our own rather than a pool of the standard library: there, one that dies fails every run that waits, and a
run goes on when its parent is gone. They are forks, which begin with all libraries and kernels loaded, and scripts that
call `fogwatch.sweep` need no `__main__` guard.
"""

from __future__ import annotations

import asyncio
import importlib
import logging
import os
import signal
import warnings
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from numbers import Integral
from types import TracebackType
from typing import Any, Protocol, Self

from experiments.sweeps.worker import Answer, Task, answer, answer_tasks, prepare_worker, run_task, software
from patrol.errors import BadInput, quoted

LOOK_UP_S = 0.5
"""Interval of looking up while no worker answers, s: a signal that comes just before the wait does not end it."""

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

    They are forks of this process. If one dies, its run has failed and it is replaced. All of them are ended when this
    process dies.
    """

    def __init__(self, size: int | None = None) -> None:
        """Start no process yet; without `size` there is one for each core that this process may use."""
        if size is not None and not (isinstance(size, Integral) and size >= 1):
            raise BadInput(f"workers = {quoted(size)}: expected 1 or more")
        self.size = size or cores()
        self._workers: dict[Connection, _Worker] = {}

    def __enter__(self) -> Self:
        importlib.import_module("fogwatch.inprocess")  # once, and not in each worker
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        while self._workers:
            _, worker = self._workers.popitem()
            worker.end()

    def work(self, tasks: Sequence[Task]) -> Iterator[Answer]:
        """Make runs; yield the answer to each task as soon as there is one, in any order."""
        waiting = deque(tasks)
        for _ in range(min(self.size, len(waiting))):
            self._give_task(_Worker(), waiting)
        while self._workers:
            for pipe in wait(self._workers, LOOK_UP_S):
                yield self._take_answer(self._workers[pipe], waiting)  # type: ignore[index]

    def _take_answer(self, worker: _Worker, waiting: deque[Task]) -> Answer:
        """Take a worker's answer, or make one if it has died; then give it or another worker the next task."""
        try:
            result: Answer = worker.pipe.recv()
            died = False
        except (EOFError, ConnectionError):
            result = answer(worker.task, f"its worker process died ({_death_cause(worker.end())})")
            died = True
        if died or not waiting:
            worker.end()
            del self._workers[worker.pipe]
        if waiting:
            self._give_task(_Worker() if died else worker, waiting)
        return result

    def _give_task(self, worker: _Worker, waiting: deque[Task]) -> None:
        self._workers[worker.pipe] = worker
        worker.give(waiting.popleft())


def cores() -> int:
    """Return the number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _death_cause(code: int) -> str:
    """Return the end of a process in words, from its exit code."""
    if code == -signal.SIGKILL:
        return "killed; was there too little memory?"
    return signal.Signals(-code).name if code < 0 else f"exit code {code}"


class _Worker:
    """One worker process, a fork of this one, and its task."""

    def __init__(self) -> None:
        context = get_context("fork")
        self.pipe, other = context.Pipe()
        self._process = context.Process(target=answer_tasks, args=(other,), daemon=True)
        with other, warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of Python 3.12 and later, where there are threads
            self._process.start()

    def give(self, task: Task) -> None:
        """Send the next task; if the worker has died meanwhile, the end of its answers shows that."""
        self.task = task
        with suppress(ConnectionError):
            self.pipe.send(task)

    def end(self) -> int:
        """End the process, whatever it is doing, unless it has ended; return its exit code."""
        self._process.kill()
        self._process.join()
        self.pipe.close()
        return self._process.exitcode or 0


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
