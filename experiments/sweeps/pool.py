"""Who makes a sweep's runs: worker processes on this machine."""

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
from types import TracebackType
from typing import IO, Protocol, Self

from experiments.sweeps.worker import Answer, Task, answer
from patrol.errors import BadInput

GRACE_S = 2.0
"""How long a worker that has closed its answers may take to end by itself."""


class WorkerPool(Protocol):
    """Workers that make runs; a context manager that leaves none behind."""

    size: int

    def __enter__(self) -> Self:
        """Get ready. BadInput when there is nobody to work."""
        ...

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """Let everybody go, in the middle of a run if need be."""
        ...

    def work(self, tasks: Sequence[Task]) -> Iterator[Answer]:
        """The answer to every task, as they come."""
        ...


class LocalWorkers:
    """Processes on this machine, each making one run at a time.

    They are started anew and share nothing with this process. One that dies fails its run and is replaced; all leave
    by themselves when this process dies.
    """

    def __init__(self, size: int | None = None) -> None:
        """size: how many processes; one for each core that this process may use, unless given."""
        if size is not None and size < 1:
            raise BadInput(f"--workers = {size}: expected 1 or more")
        self.size = size or cores()
        self._workers: dict[IO[bytes], _Worker] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        while self._workers:
            _, worker = self._workers.popitem()
            worker.end()

    def work(self, tasks: Sequence[Task]) -> Iterator[Answer]:
        """The answer to every task, as they come."""
        waiting = deque(tasks)
        with selectors.DefaultSelector() as selector:
            for _ in range(min(self.size, len(waiting))):
                self._hire(selector, waiting.popleft())
            while self._workers:
                for ready, _ in selector.select():
                    assert not isinstance(ready.fileobj, int)
                    yield self._take(selector, ready.fileobj, waiting)  # type: ignore[arg-type]

    def _hire(self, selector: selectors.BaseSelector, task: Task) -> None:
        worker = _Worker()
        self._workers[worker.answers] = worker
        selector.register(worker.answers, selectors.EVENT_READ)
        worker.give(task)

    def _take(self, selector: selectors.BaseSelector, answers: IO[bytes], waiting: deque[Task]) -> Answer:
        """A worker's answer, or what to say for it when it has died; then its next task, or its leave."""
        worker = self._workers[answers]
        task, line = worker.task, answers.readline()
        died = not line.endswith(b"\n")
        if died or not waiting:
            selector.unregister(answers)
            del self._workers[answers]
            code = worker.end(died)
            if waiting:
                self._hire(selector, waiting.popleft())
        else:
            worker.give(waiting.popleft())
            code = 0
        if died:
            return answer(task, f"its worker process died ({_cause(code)})")
        found: Answer = json.loads(line)
        return found


def cores() -> int:
    """How many processor cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _cause(code: int) -> str:
    """What an exit code says of the end of a process."""
    if code == -signal.SIGKILL:
        return "killed; was there too little memory?"
    return signal.Signals(-code).name if code < 0 else f"exit code {code}"


class _Worker:
    """One worker process and what it is at."""

    def __init__(self) -> None:
        # A group of its own: a terminal's Ctrl-C is for this process, which then ends its workers.
        command = [sys.executable, "-P", "-m", "experiments.sweeps.worker"]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, process_group=0)
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._tasks = self._process.stdin
        self.answers: IO[bytes] = self._process.stdout
        self.task: Task = {}

    def give(self, task: Task) -> None:
        """Hand over the next task; one that has died meanwhile is noticed by the end of its answers."""
        self.task = task
        with suppress(BrokenPipeError):
            self._tasks.write(json.dumps(task).encode() + b"\n")
            self._tasks.flush()

    def end(self, died: bool = False) -> int:
        """End the process, whatever it is doing, and return its exit code; one that died is let die."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(GRACE_S if died else 0.0)
        self._process.kill()
        code = self._process.wait()
        for pipe in (self._tasks, self.answers):
            with suppress(BrokenPipeError):
                pipe.close()
        return code
