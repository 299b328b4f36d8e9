"""The cost of watching: ticks per second of a fleet in lockstep with its page watched, unwatched, stopped, and without.

One run, in turn, so that whatever else the machine does falls on all four.
"""

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
    "import os, pathlib, sys\n"
    "from websockets.sync.client import connect\n"
    "os.nice(19)\n"
    "address = sys.argv[1].rstrip('/')\n"
    "frames = 0\n"
    "with connect(address.replace('http', 'ws', 1) + '/live', origin=address, max_size=None) as socket:\n"
    "    for message in socket:\n"
    '        socket.send(\'{"type": "drawn"}\')\n'
    "        frames += 1\n"
    "        if frames == 10: pathlib.Path(sys.argv[2]).touch()\n"
)
"""Draws at once whatever comes, as no browser could."""


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
def spawn() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    processes: list[subprocess.Popen[str]] = []

    def begin(*command: str, stdout: int = subprocess.DEVNULL) -> subprocess.Popen[str]:
        processes.append(subprocess.Popen(command, stdout=stdout, stderr=subprocess.DEVNULL, text=True))
        return processes[-1]

    yield begin
    for process in reversed(processes):
        if process.poll() is None:
            process.send_signal(signal.SIGCONT)
            process.terminate()
        process.wait(60)
        if process.stdout is not None:
            process.stdout.close()


def cpu_s(pid: int) -> float:
    """Processor time of a process, s."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_watching_five_costs_less_than_a_tenth(
    spawn: Callable[..., subprocess.Popen[str]], tmp_path: Path, capsys: Any
) -> None:
    folder, ready = tmp_path / "run", tmp_path / "ready"
    python = [sys.executable, "-P"]
    spawn(*python, "-m", "fogwatch", "run", "yards", "--robots", "5", "--duration", "1000000", "--quiet",
          "--out", str(folder), "--no-recording", "--no-report", "--no-page")  # fmt: skip
    until((folder / "control.json").exists)
    table = folder / "ticks.csv"
    until(lambda: lines(table) > 10)
    rates: dict[str, list[float]] = {"alone": [], "page": [], "watched": [], "stopped": []}
    used = 0.0

    def measure(how: str) -> None:
        time.sleep(SETTLE_S)
        before, began = lines(table), time.monotonic()
        time.sleep(WINDOW_S)
        rates[how].append((lines(table) - before) / (time.monotonic() - began))

    for _ in range(ROUNDS):
        measure("alone")
        page = spawn(*python, "-m", "monitor", "--access", str(folder / "control.json"), stdout=subprocess.PIPE)
        assert page.stdout is not None
        address = next(line for line in page.stdout if line.startswith("page: ")).removeprefix("page: ").strip()
        measure("page")
        viewer = spawn(*python, "-c", VIEWER, address.partition("/?")[0], str(ready))
        until(ready.exists)
        cpu = cpu_s(page.pid)
        measure("watched")
        used += cpu_s(page.pid) - cpu
        page.send_signal(signal.SIGSTOP)
        measure("stopped")
        for process in (viewer, page):
            process.kill()
            process.wait(60)
        ready.unlink()
    median = {how: statistics.median(values) for how, values in rates.items()}
    with capsys.disabled():
        print()
        for how, values in rates.items():
            share = median[how] / median["alone"]
            print(f"{how}: {median[how]:.1f} ticks/s, {share:.3f} ({', '.join(f'{rate:.1f}' for rate in values)})")
        print(f"the watched page used {used / (ROUNDS * (WINDOW_S + SETTLE_S)):.2f} of a processor")
    for how in ("page", "watched", "stopped"):
        assert median[how] >= (1.0 - MOST) * median["alone"], how
