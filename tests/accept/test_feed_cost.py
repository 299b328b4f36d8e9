"""What watching costs: ticks per second of a fleet in lockstep with a viewer at work, a stopped one, and none.

One run, in turn, so that whatever else the machine does falls on all three.
"""

from __future__ import annotations

import os
import signal
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytestmark = [pytest.mark.accept, pytest.mark.processes, pytest.mark.timeout(900)]

PATIENCE_S = 120.0
WINDOW_S, SETTLE_S, ROUNDS = 4.0, 1.0, 6
MOST = 0.10
"""The share of the ticks per second that watching may cost."""

VIEWER = (
    "import os, sys, pathlib\n"
    "from monitor.attach import open_fleet\n"
    "from patrol.lifeline import Ending\n"
    "os.nice(10)\n"
    "source = open_fleet(Ending(), access=pathlib.Path(sys.argv[1]))\n"
    "source.wait(10.0)\n"
    "source.last_seen('truth')\n"
    "pathlib.Path(sys.argv[2]).touch()\n"
    "while True: source.wait(0.05)\n"
)


def until(what: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE_S
    while not what():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.01)


def lines(path: Path) -> int:
    try:
        return path.read_bytes().count(b"\n")
    except OSError:
        return 0


@pytest.fixture
def spawn() -> Iterator[Callable[..., subprocess.Popen[bytes]]]:
    processes: list[subprocess.Popen[bytes]] = []

    def begin(*command: str) -> subprocess.Popen[bytes]:
        processes.append(subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
        return processes[-1]

    yield begin
    for process in reversed(processes):
        if process.poll() is None:
            process.send_signal(signal.SIGCONT)
            process.terminate()
        process.wait(60)


def cpu_s(pid: int) -> float:
    """Processor time of a process, s."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_watching_a_fleet_of_five_costs_less_than_a_tenth(
    spawn: Callable[..., subprocess.Popen[bytes]], tmp_path: Path, capsys: Any
) -> None:
    folder, ready = tmp_path / "run", tmp_path / "ready"
    python = [sys.executable, "-P"]
    spawn(*python, "-m", "fogwatch", "run", "yards", "--robots", "5", "--duration", "1000000", "--quiet",
          "--out", str(folder), "--no-recording", "--no-report", "--no-page")  # fmt: skip
    until((folder / "control.json").exists)
    table = folder / "ticks.csv"
    until(lambda: lines(table) > 10)
    rates: dict[str, list[float]] = {"watched": [], "stopped": [], "alone": []}
    used = 0.0

    def measure(how: str) -> None:
        time.sleep(SETTLE_S)
        before, began = lines(table), time.monotonic()
        time.sleep(WINDOW_S)
        rates[how].append((lines(table) - before) / (time.monotonic() - began))

    for _ in range(ROUNDS):
        viewer = spawn(*python, "-c", VIEWER, str(folder), str(ready))
        until(ready.exists)
        cpu = cpu_s(viewer.pid)
        measure("watched")
        used += cpu_s(viewer.pid) - cpu
        viewer.send_signal(signal.SIGSTOP)
        measure("stopped")
        viewer.kill()
        viewer.wait(60)
        ready.unlink()
        measure("alone")
    watched, stopped, alone = (statistics.median(rates[how]) for how in ("watched", "stopped", "alone"))
    with capsys.disabled():
        print(f"\nnobody watches: {alone:.1f} ticks/s")
        print(f"watched: {watched:.1f}, {watched / alone:.3f} of it; its viewer stopped: {stopped / alone:.3f}")
        print(f"the viewer used {used / (ROUNDS * (WINDOW_S + SETTLE_S)):.2f} of a processor")
        for how, values in rates.items():
            print(f"{how}: {[round(rate, 1) for rate in values]}")
    assert stopped >= (1.0 - MOST) * alone
    assert watched >= (1.0 - MOST) * alone
