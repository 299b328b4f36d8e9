"""Fleets as processes, by the command line: how fast they go, how fast a robot's process starts, and what it holds."""

from __future__ import annotations

import csv
import io
import json
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from experiments.bench.tools.groups import FLEETS, MEMORY, START_UP
from experiments.bench.tools.measure import Effort, Measured, Task, Unmeasured
from experiments.bench.tools.procfs import Process, family_of, loopback_bytes, memory_of, since_boot

CARS = 5
STEP_S = 0.5
PATIENCE_S = 300.0
"""How long a fleet may take for what is waited for, wall s."""
POLL_S = 0.002
GOODBYE_S = 30.0
RUNS, RUNS_QUICK = 3, 1
DURATION_S, DURATION_QUICK_S = 600, 30
MANY, MANY_QUICK = 50, 10
RESTARTS, RESTARTS_QUICK = 10, 2
EVERY_S = 10
"""From one restart of a robot to the next, simulated s."""
TICKS_BEFORE, TICKS_BEFORE_QUICK = 200, 20
"""Ticks after which memory is read."""

PROGRAMS = (
    ("agent", "an agent"),
    ("agent.fork_server", "the fork server"),
    ("worldsim", "the world"),
    ("fogwatch.router", "the router"),
)
"""The modules that the processes of a run stand for, and what they are called."""

WITHOUT_FILES = ("--no-page", "--no-recording", "--no-report")


def tasks() -> list[Task]:
    """The measures of fleets as processes."""
    return [
        Task(FLEETS, "five cars as processes, site, page and recording (make demo)", partial(_runs, "site", ())),
        Task(FLEETS, "five cars as processes, yards", partial(_runs, "yards", WITHOUT_FILES)),
        Task(FLEETS, "fifty cars as processes, yards at 0.5 m, in real time", _deadlines),
        Task(START_UP, "an agent of five, site", partial(_start_up, "site")),
        Task(START_UP, "an agent of five, yards", partial(_start_up, "yards")),
        Task(MEMORY, "five cars as processes, site", partial(_memory, "site")),
        Task(MEMORY, "five cars as processes, yards", partial(_memory, "yards")),
    ]


@contextmanager
def fleet(*arguments: str) -> Iterator[tuple[subprocess.Popen[bytes], Path]]:
    """`fogwatch run` with a folder of its own; when the block is left, the fleet is ended in order.

    Args:
        arguments: Of the command, but for the folder.

    Yields:
        The process and the run's folder.
    """
    with TemporaryDirectory(prefix="fogwatch-bench-") as home:
        folder = Path(home) / "run"
        command = [sys.executable, "-P", "-m", "fogwatch", "run", *arguments, "--out", str(folder)]
        log = Path(home) / "log"
        with log.open("xb") as output:
            process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=output, stderr=output, process_group=0)
            try:
                yield process, folder
            finally:
                _end(process)


def _end(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
    try:
        process.wait(GOODBYE_S)
    except subprocess.TimeoutExpired:
        process.kill()  # its children end by themselves, since their lifeline ends
        process.wait()


def _runs(terrain: str, options: Sequence[str], effort: Effort) -> Sequence[Measured]:
    """Whole runs, from the command to its end."""
    runs, duration = (RUNS_QUICK, DURATION_QUICK_S) if effort.quick else (RUNS, DURATION_S)
    ticks = CARS * duration / STEP_S
    readings: dict[tuple[str, str], list[float]] = {}
    for _ in range(runs):
        used, sent, begun = _children_s(), loopback_bytes(), time.perf_counter()
        with fleet(terrain, "--robots", str(CARS), "--duration", str(duration), *options) as (process, folder):
            _await_end(process, duration)
            summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        wall, spent = time.perf_counter() - begun, _children_s() - used
        found = {
            ("robot-seconds per second and core", "robot-s/s"): CARS * duration / spent,
            ("times real time", "x"): summary["realtime_factor"],
            ("the whole command", "s, wall"): wall,
            ("all processes", "s"): spent,
            ("bytes sent per robot and tick", "bytes"): summary["messages"]["bytes_per_robot_s"] * STEP_S,
            ("loopback bytes per robot and tick", "bytes"): (loopback_bytes() - sent) / ticks,
        }
        for name, value in found.items():
            readings.setdefault(name, []).append(value)
    return [Measured(name, unit, tuple(values)) for (name, unit), values in readings.items()]


def _deadlines(effort: Effort) -> Sequence[Measured]:
    """What a fleet misses that does not wait for its robots."""
    robots, duration = (MANY_QUICK, DURATION_QUICK_S) if effort.quick else (MANY, DURATION_S)
    body = ("--robots", str(robots), "--point", "0.5", "--pace", "realtime", "--duration", str(duration))
    used = _children_s()
    with fleet("yards", *body, *WITHOUT_FILES) as (process, folder):
        _await_end(process, duration)
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    of = f"of {robots * summary['ticks']}"
    late = summary["deadlines"]
    return [
        Measured("commands missed", "", (float(sum(one["missed"] for one in summary["robots"].values())),), says=of),
        Measured("ticks without frames in time", "", (float(sum(late["late_frames"].values())),), says=of),
        Measured("the world fell behind by", "s, wall", (float(late["slipped_s"]),)),
        Measured(
            "the world was held up for", "s, wall", (float(late["held_up_s"]),), says="deadlines moved by as much"
        ),
        Measured("most of that in one tick", "s, wall", (float(late["longest_held_up_s"]),)),
        Measured("cores in use", "", ((_children_s() - used) / duration,), says="start and verdict included"),
    ]


def _start_up(terrain: str, effort: Effort, options: Sequence[str] = ()) -> Sequence[Measured]:
    """Kill a robot and start it again, over and over, in a fleet that waits for it."""
    count = RESTARTS_QUICK if effort.quick else RESTARTS
    faults = [
        fault
        for number in range(count)
        for fault in (
            {"kind": "kill", "who": "r1", "at": EVERY_S * (number + 0.5)},
            {"kind": "restart", "who": "r1", "at": EVERY_S * (number + 1.0)},
        )
    ]
    duration = str(EVERY_S * (count + 1))
    wall, processor = [], []
    arguments = ("--robots", str(CARS), "--duration", duration, "--set", f"faults={json.dumps(faults)}")
    with fleet(terrain, *arguments, *WITHOUT_FILES, *options) as (process, folder):
        for number in range(count):
            # A tick's line is written in the tick after it, once all robots have been asked for their decisions.
            _await_line(process, folder, round(EVERY_S * (number + 1.0) / STEP_S))
            now = since_boot()
            agent = _newest_agent(process, "r1", number + 2)
            wall.append(now - agent.began)
            processor.append(agent.processor)
    says = "includes part of the next tick, in which the world writes it down"
    return [
        Measured("until the first decision, wall time", "s", tuple(wall), says=says),
        Measured("until the first decision, processor time", "s", tuple(processor), says=says),
    ]


def _memory(terrain: str, effort: Effort, options: Sequence[str] = ()) -> Sequence[Measured]:
    """What each process holds in the middle of a run."""
    ticks = TICKS_BEFORE_QUICK if effort.quick else TICKS_BEFORE
    with fleet(terrain, "--robots", str(CARS), "--duration", str(DURATION_S), *WITHOUT_FILES, *options) as (
        process,
        folder,
    ):
        _await_line(process, folder, ticks)
        held = [(_program(one), memory_of(one.pid)) for one in family_of(process.pid)]
    found = []
    for program, called in PROGRAMS:
        own = [memory for name, memory in held if name == program]
        if not own:
            raise Unmeasured(f"found no process of {called}")
        found += [
            Measured(f"{called}, resident", "MB", tuple(memory.rss for memory in own)),
            Measured(f"{called}, its share (PSS)", "MB", tuple(memory.pss for memory in own)),
            Measured(f"{called}, of its own", "MB", tuple(memory.private for memory in own)),
        ]
    return found


def _await_end(process: subprocess.Popen[bytes], duration: float) -> None:
    """Wait until a run has ended by itself."""
    try:
        code = process.wait(PATIENCE_S + duration)
    except subprocess.TimeoutExpired:
        raise Unmeasured(f"fogwatch run did not end within {PATIENCE_S + duration:g} s") from None
    if code != 0:
        raise Unmeasured(f"fogwatch run ended with {code}")


def _await_line(process: subprocess.Popen[bytes], folder: Path, k: int) -> None:
    """Wait until the table of ticks has the line of a tick."""
    table, until = folder / "ticks.csv", time.monotonic() + PATIENCE_S
    size = 0
    while time.monotonic() < until:
        try:
            grown = table.stat().st_size
        except OSError:
            grown = 0
        if grown != size:
            size = grown
            if _last_tick(table) >= k:
                return
        if process.poll() is not None:
            raise Unmeasured(f"fogwatch run ended with {process.returncode} before tick {k}")
        time.sleep(POLL_S)
    raise Unmeasured(f"tick {k} was not done within {PATIENCE_S:g} s")


def _last_tick(table: Path) -> int:
    lines = [line for line in table.read_text(encoding="ascii").splitlines(keepends=True) if line.endswith("\n")]
    rows = list(csv.reader(io.StringIO("".join(lines[-1:]))))
    return int(rows[0][0]) if len(lines) > 1 else -1


def _newest_agent(process: subprocess.Popen[bytes], robot: str, incarnation: int) -> Process:
    wanted = ("agent", robot, str(incarnation))
    for one in family_of(process.pid):
        if (_program(one), _option(one, "--robot"), _option(one, "--incarnation")) == wanted:
            return one
    raise Unmeasured(f"found no process of robot {robot}")


def _program(process: Process) -> str:
    """The module that a process of Python runs; empty for another process."""
    return _option(process, "-m")


def _option(process: Process, name: str) -> str:
    """What stands behind an option in a process's command line; empty where it has none."""
    words = process.words
    return words[words.index(name) + 1] if name in words[:-1] else ""


def _children_s() -> float:
    """Processor time of all children that have ended and were waited for, and of theirs, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
