"""The runs of a sweep on a Dask cluster that is already running."""

from __future__ import annotations

import asyncio
import importlib
import logging
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import Any, Self

from experiments.sweeps.worker import Answer, Task, answer, prepare_worker, run_task, software
from patrol.errors import BadInput

TIMEOUT_S = 10.0
"""Longest wait for the scheduler to answer, and for a first worker."""


class ClusterWorkers:
    """The workers of a Dask cluster (`experiments.sweeps.pool.WorkerPool`).

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
        dask = _distributed()
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
        given = {future.key: task for future, task in zip(futures, tasks, strict=True)}
        for future in _distributed().as_completed(futures, loop=self._client.loop):
            task = given[future.key]
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


def _distributed() -> Any:
    """Import Dask's library, which is an optional dependency and has no types."""
    try:
        return importlib.import_module("distributed")
    except ImportError:
        raise BadInput("cluster: needs Dask; install it with: pip install 'fogwatch[experiments]'") from None
