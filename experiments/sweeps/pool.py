"""The workers that make the runs of a sweep: processes of this machine."""

from __future__ import annotations

import json
import os
import selectors
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from numbers import Integral
from types import TracebackType
from typing import IO, Protocol, Self

from experiments.sweeps.worker import Answer, Task, answer
from patrol.errors import BadInput, quoted
from patrol.starting.environment import own_environment

LOOK_UP_S = 0.5
"""Interval of looking up while no worker answers, s: a signal that comes just before the wait does not end it."""

GRACE_S = 2.0
"""Longest wait for a worker that has closed its output to end by itself."""


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
                    yield self._take(selector, ready.fileobj, waiting)  # type: ignore[arg-type]

    def _start_worker(self, selector: selectors.BaseSelector, task: Task) -> None:
        worker = _Worker()
        self._workers[worker.answers] = worker
        selector.register(worker.answers, selectors.EVENT_READ)
        worker.give(task)

    def _take(self, selector: selectors.BaseSelector, answers: IO[bytes], waiting: deque[Task]) -> Answer:
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
            return answer(task, f"its worker process died ({_cause(code)})")
        result: Answer = json.loads(line)
        return result


def cores() -> int:
    """Return the number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _cause(code: int) -> str:
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
