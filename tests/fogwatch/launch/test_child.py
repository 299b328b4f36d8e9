"""A child in words, by its exit code and its log, and how children are ended; none of them is a process."""

import json
import os
import signal
import socket
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from fogwatch.launch.child_control import ProcessControlServer, state_of
from fogwatch.launch.children import Child, Children, Forked
from patrol.errors import BadInput
from runtime.process.failures import LEAST
from worldsim.fleet.process_control import ENDED, Request


class Process:
    """A process that ends when it is told to; it heeds some signals."""

    def __init__(self, *heeds: int, code: int | None = None) -> None:
        self.pid = 2**22 + 1  # beyond all that there are
        self.code = code
        self.heeds = heeds
        self.got: list[int] = []

    def poll(self) -> int | None:
        return self.code

    def wait(self) -> int:
        assert self.code is not None, "it would wait for ever"
        return self.code

    def send_signal(self, number: int) -> None:
        self.got.append(number)
        if number in self.heeds:
            self.code = -number

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


def child_of(process: Any, folder: Path = Path(), name: str = "r1") -> Child:
    return Child(name, process, folder / "log")


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0, "r1 ended with exit code 0"),
        (3, "r1 ended with exit code 3"),
        (-9, "r1 was killed by SIGKILL"),
        (-15, "r1 was killed by SIGTERM"),
    ],
)
def test_an_end_in_words(code: int, words: str, tmp_path: Path) -> None:
    child = child_of(Process(code=code), tmp_path)
    assert child.poll() == code
    assert child.describe_exit() == child.describe_end() == words
    child.log.write_text("".join(f"line {n}\n" for n in range(9)), encoding="utf-8")
    quoted = "\n".join(f"    line {n}" for n in range(4, 9))
    assert child.describe_end() == f"{words}; the end of its log ({child.log}):\n{quoted}"
    assert child.last_words() == "line 8"
    assert not child.has_traceback
    child.log.write_bytes(b"x\nTraceback (most recent call last):\n  File\nr1: r1: last\n")
    assert child.has_traceback
    assert child.last_words() == "r1: last"


def test_an_exit_code_stays_that_of_the_first_look(tmp_path: Path) -> None:
    process = Process()
    child = child_of(process, tmp_path)
    assert child.poll() is None
    process.code = 7
    assert child.poll() == 7
    process.code = 8
    assert (child.poll(), child.code) == (7, 7)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """A clock that sleeping moves."""
    now = [0.0]

    def sleep(length_s: float) -> None:
        now[0] += length_s

    monkeypatch.setattr("fogwatch.launch.children.time.monotonic", lambda: now[0])
    monkeypatch.setattr("fogwatch.launch.children.time.sleep", sleep)
    return now


def fleet(urgent: bool = False, **processes: Process) -> Children:
    children = Children(lambda: urgent)
    children.by_name |= {name: child_of(process, name=name) for name, process in processes.items()}
    return children


TERM, CONT, KILL = signal.SIGTERM, signal.SIGCONT, signal.SIGKILL


def test_children_are_told_to_end_and_killed_only_where_they_do_not(clock: list[float]) -> None:
    heeds, stubborn, gone = Process(TERM, KILL), Process(KILL), Process(code=0)
    children = fleet(a=heeds, b=stubborn, c=gone)
    children.end(["a", "b", "c"])
    assert (heeds.got, stubborn.got, gone.got) == ([TERM], [TERM, CONT, KILL], [])
    assert [child.code for child in children.by_name.values()] == [-TERM, -KILL, 0]
    assert clock[0] == pytest.approx(20.0, abs=0.02)


def test_where_it_is_urgent_they_are_killed_at_once(clock: list[float]) -> None:
    heeds = Process(TERM, KILL)
    fleet(urgent=True, a=heeds).end(["a"])
    assert heeds.got == [KILL]
    assert clock[0] == 0.0


def test_waiting_ends_with_the_last_of_those_that_are_named(clock: list[float]) -> None:
    children = fleet(a=Process(code=0), b=Process())
    children.wait(["a", "unknown"], 5.0)
    assert clock[0] == 0.0
    children.wait(["a", "b"], 5.0)
    assert clock[0] == pytest.approx(5.0, abs=0.02)
    children.signal(["b", "unknown"], signal.SIGUSR1)
    assert children.by_name["b"].process.got == [signal.SIGUSR1]  # type: ignore[union-attr]


def test_the_state_is_the_letter_that_the_kernel_gives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A name may hold spaces and brackets."""
    stat = tmp_path / "stat"
    stat.write_text("77 (a) b) (c)) T 1 2 3 R", encoding="ascii")
    monkeypatch.setattr("fogwatch.launch.child_control.Path", lambda named: stat if named == "/proc/77/stat" else None)
    assert state_of(child_of(SimpleNamespace(pid=77))) == "T"
    monkeypatch.undo()
    assert state_of(child_of(SimpleNamespace(pid=os.getpid()))) in "RSD"
    assert state_of(child_of(Process())) == ""


def started(program: str) -> Forked:
    command = [sys.executable, "-S", "-c", program]
    return Forked(os.posix_spawn(sys.executable, command, os.environ))


def test_a_forked_child_ends_with_its_own_code_and_is_signalled_no_more() -> None:
    ended = started("raise SystemExit(7)")
    assert ended.wait() == ended.poll() == ended.wait() == 7
    ended.kill()
    sleeps = started("import time; time.sleep(600)")
    assert sleeps.poll() is None
    sleeps.send_signal(signal.SIGTERM)
    assert sleeps.wait() == -signal.SIGTERM


@pytest.mark.parametrize(
    ("robots", "spares", "there_gb", "fits"), [(20, 0, 3.0, True), (21, 0, 3.0, False), (25, 5, 3.0, True)]
)
def test_a_fleet_needs_memory_for_those_that_are_there(
    robots: int, spares: int, there_gb: float, fits: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """150 MB each; the router has two files open for each robot, absent or not."""
    from fogwatch.launch import launcher

    asked: list[int] = []
    sizes = {"SC_PHYS_PAGES": round(there_gb * 1e9 / 1000), "SC_PAGE_SIZE": 1000}
    monkeypatch.setattr("fogwatch.launch.launcher.os.sysconf", lambda name: sizes[name])
    monkeypatch.setattr(launcher, "allow_files", lambda count, _what: asked.append(count))
    if fits:
        launcher.check_limits(robots, spares)
        assert asked == [LEAST + 2 * robots]
    else:
        with pytest.raises(BadInput, match=r"21 robots as processes need about 3 GB of memory, and .* has 3 GB"):
            launcher.check_limits(robots, spares)


class Office:
    """A control server for two robots without processes, and the world's end of its socket."""

    def __init__(self) -> None:
        self.one, self.two = Process(KILL, TERM), Process(KILL, TERM)
        self.started: list[tuple[int, int]] = []
        ours, self.end = socket.socketpair()
        self.lines = self.end.makefile("rb")
        self.children = fleet(r1=self.one, r2=self.two)
        self.server = ProcessControlServer(ours, self.children, ["r1", "r2"], lambda *what: self.started.append(what))

    def ask(self, do: str, robot: int, incarnation: int = 0) -> dict[str, str]:
        self.end.sendall(Request(do, robot, incarnation).line())
        answer: dict[str, str] = json.loads(self.lines.readline())
        return answer


@pytest.fixture
def office(clock: list[float]) -> Iterator[Office]:
    assert clock == [0.0]
    office = Office()
    yield office
    office.lines.close()
    office.end.close()
    office.server.close()


DONE = {"problem": "", "state": ""}


def test_a_request_concerns_the_robot_of_its_number_alone(office: Office) -> None:
    assert office.ask("kill", 2) == DONE
    assert (office.one.got, office.two.got) == ([], [KILL])
    assert [child.killed_by_fault for child in office.children.by_name.values()] == [False, True]
    assert office.ask("look", 1) == DONE
    assert office.ask("look", 2) == DONE | {"state": ENDED}
    assert office.ask("start", 2, 3) == DONE
    assert office.started == [(2, 3)]
    assert office.ask("resume", 1) == DONE
    assert office.one.got == [CONT]
    assert office.ask("leave", 1) == DONE
    assert office.one.got == [CONT, TERM]
    assert not office.children.by_name["r1"].killed_by_fault


def test_who_leaves_is_given_half_a_minute(office: Office, clock: list[float]) -> None:
    office.ask("leave", 1)
    assert clock[0] == pytest.approx(30.0, abs=0.02)
    assert office.one.got == [TERM]
