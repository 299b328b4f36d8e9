"""Helpers of tests of whole fleets: a quick scenario, what a viewer is told, and processes one by one."""

import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import fogwatch
from patrol.scenario import load_scenario
from runtime.messages.feed import Ground, SoFar, so_far_bytes
from runtime.messages.telemetry import Metrics
from worldsim.run_record import RunRecord

COARSE: dict[str, Any] = {"terrain": {"builtin": "open"}, "point": 1.0}
"""The beginning of a scenario whose ticks take little time."""


class Processes:
    """Processes that are started one by one, and what they say.

    Args:
        folder: Where their logs go.
        patience_s: How long anything may take, s.
    """

    def __init__(self, folder: Path, patience_s: float) -> None:
        self.folder = folder
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self._patience_s = patience_s

    def start(self, name: str, module: str, *arguments: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-P", "-m", module, *arguments]
        with self.log(name).open("ab") as output:
            self.processes[name] = subprocess.Popen(command, stdout=output, stderr=output)
        return self.processes[name]

    def log(self, name: str) -> Path:
        return self.folder / f"{name}.log"

    def said(self, name: str) -> str:
        return self.log(name).read_text(encoding="utf-8") if self.log(name).exists() else ""

    def code(self, name: str) -> int:
        return self.processes[name].wait(self._patience_s)

    def until(self, what: Callable[[], bool]) -> None:
        end = time.monotonic() + self._patience_s
        while not what():
            assert time.monotonic() < end, {name: self.said(name) for name in self.processes}
            time.sleep(0.02)

    def end(self) -> None:
        for process in self.processes.values():
            process.kill()
            process.wait(self._patience_s)


def python(*words: str | Path, check: bool = False, **how: Any) -> subprocess.CompletedProcess[str]:
    """Run Python to its end, and keep what it prints."""
    options = {"capture_output": True, "text": True, "timeout": 800.0, **how}
    done: subprocess.CompletedProcess[str]
    done = subprocess.run([sys.executable, "-P", *map(str, words)], check=check, **options)
    return done


def one_and_many(scenario: Mapping[str, Any], folder: Path) -> tuple[fogwatch.Run, fogwatch.Run]:
    """Run a scenario in one process and as processes: both valid, with one trace. Folders: ``one`` and ``many``."""
    told: list[Metrics] = []
    one = fogwatch.run(scenario, out=folder / "one", picture=False)
    many = fogwatch.run(scenario, out=folder / "many", in_process=False, picture=False, progress=told.append)
    assert told
    assert one.verdict.valid, one.verdict.failed
    assert many.verdict.valid, many.verdict.failed
    assert many.trace_hash == one.trace_hash
    return one, many


def trace_of(scenario: Mapping[str, Any] | Path, ticks: int, folder: Path) -> str:
    """Return the trace hash of the first ticks of a scenario, run in one process; the run's folder is ``one``."""
    length = {"duration": ticks * load_scenario(scenario).step}
    return fogwatch.run(scenario, out=folder / "one", overrides=length, picture=False).trace_hash


def end_of(journal: RunRecord) -> tuple[str, str]:
    """Return why a run ended, and its trace hash; its notes hold times of the machine, in which equal runs differ."""
    assert journal.end is not None
    return journal.end.reason, journal.end.trace_hash


def answer_so_far() -> bytes:
    """A world's answer to a viewer, on a terrain of 4 x 5 points."""
    grid = np.ones((4, 5), dtype=np.bool_)
    ground = Ground(grid, ~grid, (grid,), {1: 0})
    seen, curve = np.full((4, 5), 2, dtype=np.int32), np.arange(3, dtype=np.float32)
    return so_far_bytes(
        SoFar(9, b"header", None, seen, (), 0, (b"asked",), 1, curve, curve, True, None, {1: 0.5}, ground)
    )
