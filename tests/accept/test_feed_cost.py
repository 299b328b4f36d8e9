"""What watching costs: ticks per second of a fleet in lockstep with a viewer at work, against the same viewer stopped.

One run, one machine: the viewer is stopped and let go on in turn, so that whatever else the machine does falls on both.
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
WINDOW_S, SETTLE_S, ROUNDS = 4.0, 1.0, 8
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
    viewer = spawn(*python, "-c", VIEWER, str(folder), str(ready))
    until(ready.exists)
    table = folder / "ticks.csv"
    rates: dict[int, list[float]] = {signal.SIGCONT: [], signal.SIGSTOP: []}
    used = 0.0
    for turn in range(2 * ROUNDS):
        order = (signal.SIGCONT, signal.SIGSTOP) if turn % 4 in (0, 3) else (signal.SIGSTOP, signal.SIGCONT)
        how = order[turn % 2]
        viewer.send_signal(how)
        time.sleep(SETTLE_S)
        before, began, cpu = lines(table), time.monotonic(), cpu_s(viewer.pid)
        time.sleep(WINDOW_S)
        rates[how].append((lines(table) - before) / (time.monotonic() - began))
        used += cpu_s(viewer.pid) - cpu
    watched, alone = (statistics.median(rates[how]) for how in (signal.SIGCONT, signal.SIGSTOP))
    with capsys.disabled():
        print(
            f"\nwatched {watched:.1f} ticks/s, viewer stopped {alone:.1f}: {watched / alone:.3f}; "
            f"the viewer used {used / (ROUNDS * WINDOW_S):.2f} of a processor\n"
            f"watched: {[round(rate, 1) for rate in rates[signal.SIGCONT]]}\n"
            f"stopped: {[round(rate, 1) for rate in rates[signal.SIGSTOP]]}"
        )
    assert watched >= (1.0 - MOST) * alone
