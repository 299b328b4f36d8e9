"""Fleets of processes, as `fogwatch run` makes them: wall time per tick, of the whole command, and memory.

The memory of a process is its share (PSS): pages that several processes map are divided among them, so shares add up.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import psutil

from bench.runner import Bench

CARS = 5
DURATION_S = 600
STEP_S = 0.5
MEMORY_TICK = 200
"""The tick after which memory is read."""

PATIENCE_S = 300.0
"""Longest time that a fleet may take for what is waited for, wall s."""
POLL_S = 0.05
GOODBYE_S = 30.0

WITHOUT_FILES = ("--no-page", "--no-recording", "--no-report")
FLEETS: Mapping[str, Sequence[str]] = {
    "five cars, site, with page, recording and report": ("site",),
    "five cars, yards": ("yards", *WITHOUT_FILES),
}
"""The arguments of `fogwatch run` by what they run."""

PROGRAMS = {
    "agent": "an agent",
    "agent.fork_server": "the fork server",
    "worldsim": "the world",
    "fogwatch.router": "the router",
}
"""Names of a run's processes, by the module that they run."""


def main() -> None:
    """Measure all fleets."""
    bench = Bench(
        "processes", processes=3, values=1, warmups=0, loops=1, options={"duration": DURATION_S, "tick": MEMORY_TICK}
    )
    duration_s, tick = bench.option("duration"), bench.option("tick")
    for fleet, arguments in FLEETS.items():
        bench.time(f"{fleet}: a tick, wall", partial(tick_time, arguments, duration_s))
        bench.time(f"{fleet}: the whole command, {duration_s} s, wall", partial(command_time, arguments, duration_s))
        for program, name in PROGRAMS.items():
            bench.time(f"{fleet}: memory of {name}", partial(memory, arguments, tick, program), unit="byte")
    bench.end()


def tick_time(arguments: Sequence[str], duration_s: int, loops: int) -> float:
    """Run fleets, and return the wall time of a tick as the runs themselves measure it, s.

    Args:
        arguments: Of `fogwatch run`.
        duration_s: Simulated time, s.
        loops: Runs.

    Returns:
        The wall time of a tick, of all runs together, s.
    """

    def of_run(folder: Path) -> float:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        return STEP_S / float(summary["realtime_factor"])

    return sum(_run(arguments, duration_s, of_run) for _ in range(loops))


def command_time(arguments: Sequence[str], duration_s: int, loops: int) -> float:
    """Run fleets, and return the wall time from the command to its end, of all runs together, s.

    Args:
        arguments: Of `fogwatch run`.
        duration_s: Simulated time, s.
        loops: Runs.
    """
    spent_s = 0.0
    for _ in range(loops):
        begun_s = time.perf_counter()
        _run(arguments, duration_s, lambda _: 0.0)
        spent_s += time.perf_counter() - begun_s
    return spent_s


def memory(arguments: Sequence[str], tick: int, program: str, loops: int) -> float:
    """Run fleets, and return what a process holds in the middle of a run.

    Args:
        arguments: Of `fogwatch run`.
        tick: The tick to wait for.
        program: The module that the process runs; where several do, the mean.
        loops: Runs.

    Returns:
        Its share of the memory (PSS), of all runs together, bytes.

    Raises:
        RuntimeError: There is no such process, or the run ended too early.
    """
    total = 0.0
    for _ in range(loops):
        with running("run", *arguments, "--robots", str(CARS), "--duration", str(DURATION_S)) as (process, folder):
            await_tick(process, folder, tick)
            shares = [
                float(child.memory_full_info().pss)
                for child in psutil.Process(process.pid).children(recursive=True)
                if module_of(child) == program
            ]
        if not shares:
            raise RuntimeError(f"there is no process of {PROGRAMS[program]}")
        total += sum(shares) / len(shares)
    return total


@contextmanager
def running(*arguments: str) -> Iterator[tuple[subprocess.Popen[bytes], Path]]:
    """Run `fogwatch` with a run folder of its own, and end it in order when the block is left.

    Args:
        arguments: Of the command, without the folder.

    Yields:
        The process and the run's folder.
    """
    with TemporaryDirectory(prefix="fogwatch-bench-") as home:
        folder = Path(home) / "run"
        command = [sys.executable, "-P", "-m", "fogwatch", *arguments, "--out", str(folder)]
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        try:
            yield process, folder
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
            try:
                process.wait(GOODBYE_S)
            except subprocess.TimeoutExpired:
                process.kill()  # its children end by themselves, since their lifeline ends
                process.wait()


def await_tick(process: subprocess.Popen[bytes], folder: Path, tick: int) -> None:
    """Wait until a run has done a tick.

    Args:
        process: Of `fogwatch run`.
        folder: The run's.
        tick: The tick.

    Raises:
        RuntimeError: The run has ended, or takes too long.
    """
    table, until_s = folder / "ticks.csv", time.monotonic() + PATIENCE_S
    while not table.exists() or table.read_bytes().count(b"\n") <= tick + 1:  # the first line names the columns
        if process.poll() is not None:
            raise RuntimeError(f"fogwatch run ended with {process.returncode} before tick {tick}")
        if time.monotonic() > until_s:
            raise RuntimeError(f"tick {tick} was not done within {PATIENCE_S:g} s")
        time.sleep(POLL_S)


def module_of(process: psutil.Process) -> str:
    """Return the module that a process of Python runs; empty for another process, and one that has ended.

    Args:
        process: The process.
    """
    try:
        words: list[str] = process.cmdline()
    except psutil.Error:
        return ""
    return words[words.index("-m") + 1] if "-m" in words[:-1] else ""


def _run(arguments: Sequence[str], duration_s: int, result: Callable[[Path], float]) -> float:
    """Run a fleet to its end, and return what is read from its folder."""
    with running("run", *arguments, "--robots", str(CARS), "--duration", str(duration_s)) as (process, folder):
        code = process.wait(PATIENCE_S + duration_s)
        if code != 0:
            raise RuntimeError(f"fogwatch run ended with {code}")
        return result(folder)


if __name__ == "__main__":
    main()
