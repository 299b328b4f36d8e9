"""A sweep's runs on a Dask cluster: the same function, on workers that somebody else has started."""

from __future__ import annotations

import asyncio
import importlib
import logging
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import Any, Self

from experiments.sweeps.worker import Answer, Task, answer, greet, run_task, software
from patrol.errors import BadInput

PATIENCE_S = 10.0
"""How long to wait for a scheduler to answer and for a first worker."""


class ClusterWorkers:
    """The workers of a Dask cluster that is already there.

    Each needs this version of this software, and a map at the path that the scenario names. Runs on the cluster that
    have begun when the sweep is interrupted end in their own time; nobody waits for them.
    """

    def __init__(self, address: str, patience_s: float = PATIENCE_S) -> None:
        """address: of the scheduler, such as tcp://host:8786. BadInput where Dask is missing."""
        self.size = 0
        self._address = address
        self._patience_s = patience_s
        self._client: Any = None

    def __enter__(self) -> Self:
        dask = _distributed()
        logging.getLogger("distributed").setLevel(logging.CRITICAL)  # it logs tracebacks of connections that end
        try:
            # A client that finds nobody keeps trying while it is taken down, so see first whether anybody answers.
            with ThreadPoolExecutor(1) as aside:  # for a notebook's own thread has an event loop already
                aside.submit(asyncio.run, _knock(self._address, self._patience_s)).result()
            self._client = dask.Client(self._address, timeout=self._patience_s, set_as_default=False)
        except Exception as error:  # noqa: BLE001 - whatever answers there may not be Dask
            why = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise BadInput(
                f"--cluster = {self._address}: cannot be reached ({why}); give the address of a running Dask "
                "scheduler, such as tcp://host:8786"
            ) from None
        try:
            self._meet(self._client)
        except BaseException:
            self._client.close()
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._client is not None:
            self._client.close()

    def work(self, tasks: Sequence[Task]) -> Iterator[Answer]:
        """The answer to every task, as they come. BadInput when the cluster is lost; what is answered stays."""
        futures = [self._client.submit(run_task, task, pure=False) for task in tasks]
        given = {future.key: task for future, task in zip(futures, tasks, strict=True)}
        for future in _distributed().as_completed(futures, loop=self._client.loop):
            task = given[future.key]
            if future.status in ("cancelled", "lost"):
                raise BadInput(
                    f"--cluster = {self._address}: was lost; start again to go on with the runs that are left"
                )
            error = future.exception()
            if error is not None:
                yield answer(task, f"its Dask worker failed: {type(error).__name__}: {error}")
                continue
            found: Answer = future.result()
            future.release()
            yield found

    def _meet(self, client: Any) -> None:
        """See that there are workers and that they run this version."""
        try:
            client.wait_for_workers(1, timeout=self._patience_s)
        except TimeoutError:
            raise BadInput(
                f"--cluster = {self._address}: has no workers; start one with: dask worker ADDRESS"
            ) from None
        try:
            versions: dict[str, Any] = client.run(greet)
        except Exception as error:  # noqa: BLE001 - whatever a foreign machine raises
            raise BadInput(
                f"--cluster = {self._address}: its workers cannot run fogwatch ({type(error).__name__}: {error}); "
                "install it on each of them"
            ) from None
        for worker, found in sorted(versions.items()):
            if found != software():
                raise BadInput(
                    f"--cluster = {self._address}: worker {worker} has fogwatch {found}, this is {software()}; "
                    "install the same on both"
                )
        self.size = sum(client.nthreads().values())


async def _knock(address: str, patience_s: float) -> None:
    """See whether a Dask scheduler, or anything that greets like one, answers at an address."""
    answering = await importlib.import_module("distributed.comm").connect(address, timeout=patience_s)
    await answering.close()


def _distributed() -> Any:
    """Dask's library, which is an extra and has no types."""
    try:
        return importlib.import_module("distributed")
    except ImportError:
        raise BadInput("--cluster needs Dask; install it with: pip install 'fogwatch[experiments]'") from None
