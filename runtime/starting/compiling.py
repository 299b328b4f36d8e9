"""Compiling kernel modules in several processes at once.

Kernels call none of another file, so modules can be compiled in any order. Each process takes the next one when it has
finished one, the longest source first, so that none is still at work long after the others.
"""

from __future__ import annotations

import json
import os
import selectors
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from patrol.errors import BadInput
from runtime.starting.environment import own_environment

WORKER = "runtime.process.compile_worker"
MOST_WORKERS = 8
"""More processes gain little: the slowest modules alone take as long."""
NICENESS = 19
"""Difference by which the priority of a process is lower that compiles while a fleet runs."""
LOOK_S = 0.5
"""Time between two looks at the clock."""


@dataclass(frozen=True, slots=True)
class Compiled:
    """The progress of compiling."""

    kernels: int  # compiled so far
    of: int  # all kernels
    left_s: float | None  # time to go; None as long as nothing is known about it


@dataclass(frozen=True, slots=True)
class _Work:
    """A module to compile; its size in bytes stands for how long that takes."""

    name: str
    source: Path
    kernels: int
    size: int


class _Worker:
    """A process that compiles one module at a time."""

    def __init__(self, niceness: int = 0) -> None:
        # In a session of its own: Ctrl-C reaches the parent alone, which ends its workers.
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", WORKER, str(niceness)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
            env=own_environment(),
        )
        self.work: _Work | None = None

    def give(self, work: _Work) -> None:
        """Have it compile a module."""
        self.work = work
        assert self.process.stdin is not None
        with suppress(BrokenPipeError):  # its end is noticed where its answer is read
            self.process.stdin.write(f"{json.dumps([work.name, str(work.source)])}\n".encode())
            self.process.stdin.flush()

    def finish(self) -> _Work:
        """Read its answer."""
        assert self.process.stdout is not None
        assert self.work is not None
        answer = self.process.stdout.readline()
        if not answer.endswith(b"\n"):
            code = self.process.wait()
            why = f"signal {-code}" if code < 0 else f"exit code {code}"
            raise BadInput(
                f"a process that compiled {self.work.source} ended with {why}; run the command again, and if there is "
                "little memory, end other programs before"
            )
        if error := json.loads(answer):
            raise BadInput(error)
        return self.work

    def end(self) -> None:
        """Kill it; what it was compiling is not stored."""
        self.process.kill()
        self.process.wait()
        for stream in (self.process.stdin, self.process.stdout):
            if stream is not None:
                with suppress(BrokenPipeError):
                    stream.close()


def compile_modules(modules: Mapping[str, Path], show: Callable[[Compiled], None]) -> None:
    """Compile kernel modules, files by full name, and store them in the cache (`patrol.kernel_cache`).

    `show` is called with the progress at each change, and every `LOOK_S`.
    """
    todo = sorted((_measure_work(name, source) for name, source in modules.items()), key=lambda work: work.size)
    of, size = sum(work.kernels for work in todo), sum(work.size for work in todo)
    ended: list[_Work] = []
    begun = time.monotonic()
    workers: list[_Worker] = []
    with selectors.DefaultSelector() as answers:
        try:
            for _ in range(min(len(os.sched_getaffinity(0)), len(todo), MOST_WORKERS)):
                workers.append(worker := _Worker())
                worker.give(todo.pop())
                assert worker.process.stdout is not None
                answers.register(worker.process.stdout, selectors.EVENT_READ, worker)
            while len(ended) < len(modules):
                for key, _ in answers.select(LOOK_S):
                    worker = key.data
                    ended.append(worker.finish())
                    if todo:
                        worker.give(todo.pop())
                    else:
                        answers.unregister(key.fileobj)
                half_done = [worker.work for worker in workers if worker.work is not None and worker.work not in ended]
                share = (sum(work.size for work in ended) + 0.5 * sum(work.size for work in half_done)) / size
                left_s = None if not ended else (time.monotonic() - begun) * (1.0 - share) / share
                show(Compiled(sum(work.kernels for work in ended), of, left_s))
        finally:
            for worker in workers:
                worker.end()


@contextmanager
def compiling_meanwhile(modules: Mapping[str, Path]) -> Iterator[None]:
    """Compile kernel modules in a process of low priority, as many as it can until the end of the context.

    It reports no errors: what it has not compiled is compiled when it is needed.
    """
    worker = _Worker(NICENESS) if modules else None
    try:
        if worker is not None:
            for name, source in modules.items():
                worker.give(_measure_work(name, source))
        yield
    finally:
        if worker is not None:
            worker.end()


def _measure_work(name: str, source: Path) -> _Work:
    text = source.read_text(encoding="utf-8")
    return _Work(name, source, text.count("@njit"), len(text))
