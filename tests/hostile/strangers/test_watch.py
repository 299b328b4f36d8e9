"""Ticks that stop, and processes that grow."""

from __future__ import annotations

from pathlib import Path

import pytest

from patrol.messages.telemetry import Metrics
from tests.hostile.strangers.run import read_log
from tests.hostile.strangers.watch import HUNG_S, SAMPLE_S, SETTLED_S, START_S, Memory, Progress

ME, STRANGER = 10, 77


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


def done(k: int) -> Metrics:
    return Metrics(k, 100, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, ())


def test_a_run_hangs_when_no_tick_comes() -> None:
    clock = Clock()
    progress = Progress(clock)
    clock.now = 1000.0
    progress.begin()
    clock.now += START_S
    assert not progress.hung
    progress.metrics(done(1))
    clock.now += HUNG_S
    progress.metrics(done(2))
    clock.now += HUNG_S
    progress.metrics(done(2))
    assert not progress.hung
    clock.now += 1.0
    assert progress.hung
    assert (progress.ticks, progress.stalled_s) == (2, HUNG_S + 1.0)
    progress.metrics(done(3))
    assert progress.longest_s == HUNG_S + 1.0


def test_a_run_that_never_begins_hangs() -> None:
    clock = Clock()
    progress = Progress(clock)
    clock.now += START_S + 1.0
    assert progress.hung


@pytest.fixture
def proc(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr("tests.hostile.strangers.watch._PROC", tmp_path)
    return tmp_path


def write(proc: Path, number: int, parent: int, peak_mb: float, *words: str) -> None:
    folder = proc / str(number)
    folder.mkdir(exist_ok=True)
    (folder / "stat").write_text(f"{number} (a (name) S) S {parent} 1 1", encoding="utf-8")
    (folder / "status").write_text(f"Name:\tpython\nVmHWM:\t{peak_mb * 1024:.0f} kB\n", encoding="utf-8")
    (folder / "cmdline").write_text("\0".join(["python", *words, ""]), encoding="utf-8")


def test_growth_counts_from_when_the_stranger_comes(proc: Path) -> None:
    clock = Clock()
    memory = Memory(clock, ME)
    peaks = iter([100.0, 200.0, 200.0, 999.0])

    def rest(duration_s: float) -> None:
        clock.now += duration_s
        write(proc, 11, ME, next(peaks), "-m", "worldsim")

    memory.settle(rest, lambda: False)
    assert clock.now == 3 * SAMPLE_S, "a process that has not grown for a while has settled"

    def look(world_mb: float, robot_mb: float) -> None:
        write(proc, 11, ME, world_mb, "-m", "worldsim")
        write(proc, 12, ME, robot_mb, "-m", "agent", "--robot", "r1")
        write(proc, 13, 1, 10 * clock.now, "-m", "monitor")
        write(proc, STRANGER, ME, 10 * clock.now, "-m", "tests.hostile.strangers.stranger")
        (proc / "99").mkdir(exist_ok=True)  # it has just ended
        memory.look(but=STRANGER)

    look(550, 50)
    assert memory.growth_mb == {"worldsim": 350.0, "r1": 0.0}, "however soon after the stranger has come"
    clock.now += SAMPLE_S
    look(560, 61)
    clock.now += SAMPLE_S / 2
    look(900, 61)
    assert memory.growth_mb == {"worldsim": 360.0, "r1": 11.0}


@pytest.mark.parametrize("over", [False, True])
def test_processes_that_go_on_growing_are_not_waited_for_for_ever(over: bool, proc: Path) -> None:
    clock = Clock()

    def rest(duration_s: float) -> None:
        clock.now += duration_s
        write(proc, 11, ME, clock.now, "-m", "worldsim")

    Memory(clock, ME).settle(rest, lambda: over)
    assert clock.now == (0.0 if over else SETTLED_S)


def test_a_stranger_s_log_says_what_was_tried(tmp_path: Path) -> None:
    log = tmp_path / "stranger.log"
    assert read_log(log) == ({}, {}, "")
    lines = [
        '{"begins": "floods"}',
        '{"attack": "floods", "counts": {"messages": 3}}',
        '{"attack": "floods", "counts": {"messages": 4, "bytes": 1}}',
        "7",
        "KeyError: \x1b[2J",
        '{"begins": "noise"}',
    ]
    log.write_text("\n".join(lines), encoding="utf-8")
    assert read_log(log) == ({"floods": 1, "noise": 1}, {"attacks": 2, "messages": 7, "bytes": 1}, "KeyError: \\x1b[2J")
