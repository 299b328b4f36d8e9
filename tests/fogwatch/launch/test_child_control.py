"""The launcher's side of process control: real processes, stopped, killed and waited for."""

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from fogwatch.launch.child_control import ProcessControlServer
from fogwatch.launch.children import Child
from fogwatch.launch.launcher import Launch
from fogwatch.run_folder.runfolder import RunFolder
from fogwatch.terminal.live_table import RunDisplay
from worldsim.fleet.process_control import ENDED, Request

pytestmark = pytest.mark.processes

SLEEPER = [sys.executable, "-c", "import time; print('here', flush=True); time.sleep(600)"]


class Office:
    """A launcher with one robot's process, and the world's end of the control socket."""

    def __init__(self, folder: Path) -> None:
        self.launch = Launch(RunFolder(folder), "f", ["r1", "r2"], RunDisplay(), lambda: False)
        ours, self.end = socket.socketpair()
        self.lines = self.end.makefile("rb")
        self.process = subprocess.Popen(SLEEPER, stdout=subprocess.PIPE)
        assert self.process.stdout is not None
        assert self.process.stdout.readline() == b"here\n"
        self.launch.children.by_name["r1"] = Child("r1", self.process, folder / "log")
        self.server = ProcessControlServer(ours, self.launch.children, self.launch.robots, self.launch.restart)

    def answer(self, what: str, robot: int = 1) -> dict[str, str]:
        self.end.sendall(Request(what, robot).line())
        answer: dict[str, str] = json.loads(self.lines.readline())
        return answer

    def ask(self, what: str, robot: int = 1) -> str:
        return self.answer(what, robot)["problem"]

    def state(self) -> str:
        stat = Path(f"/proc/{self.process.pid}/stat").read_text(encoding="ascii")
        return stat.rpartition(")")[2].split()[0]


@pytest.fixture
def office(tmp_path: Path) -> Iterator[Office]:
    office = Office(tmp_path)
    yield office
    office.end.close()
    office.server.close()
    office.process.kill()
    office.process.communicate()


def test_a_paused_process_stands_still_when_that_is_answered(office: Office) -> None:
    for _ in range(3):
        assert office.answer("pause") == {"problem": "", "state": "T"}
        assert office.state() == "T"
        assert office.answer("resume") == {"problem": "", "state": "T"}
        assert office.state() != "T"


def test_a_process_that_was_let_go_on_during_its_pause_is_seen_to_run(office: Office) -> None:
    office.ask("pause")
    office.process.send_signal(signal.SIGCONT)
    assert office.answer("resume")["state"] in ("R", "S")


def test_a_process_that_nobody_stopped_is_seen_to_run(office: Office, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fogwatch.launch.child_control.pause", lambda _child: None)
    assert office.answer("pause")["state"] in ("R", "S")


@pytest.mark.parametrize("paused", [False, True])
def test_a_killed_process_is_gone_when_that_is_answered(office: Office, paused: bool) -> None:
    if paused:
        office.ask("pause")
    assert office.ask("kill") == ""
    assert office.process.returncode == -9
    assert not Path(f"/proc/{office.process.pid}").exists()
    assert office.ask("kill") == ""
    assert office.ask("pause") == ""
    assert office.ask("resume") == ""
    assert office.launch.children.by_name["r1"].killed_by_fault


def test_a_process_is_said_to_have_ended_when_it_has_however_long_it_was_stopped(office: Office) -> None:
    assert office.answer("look") == {"problem": "", "state": ""}
    office.ask("pause")
    assert office.answer("look")["state"] == ""
    office.process.kill()
    os.waitid(os.P_PID, office.process.pid, os.WEXITED | os.WNOWAIT)
    assert office.answer("look") == {"problem": "", "state": ENDED}


def test_a_process_that_does_not_leave_in_time_is_ended(office: Office, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fogwatch.launch.child_control.GOODBYE_S", 0.1)
    assert office.ask("leave") == ""
    assert office.process.returncode == -signal.SIGTERM
    assert not office.launch.children.by_name["r1"].killed_by_fault


def test_what_cannot_be_done_is_answered_too(office: Office) -> None:
    assert office.ask("kill", robot=2) == "KeyError: 'r2'"
    assert office.ask("tickle") == "KeyError: 'tickle'"
    office.end.sendall(b"nonsense\n")
    assert "JSONDecodeError" in json.loads(office.lines.readline())["problem"]
    assert office.state() != "T"


def test_it_ends_with_the_world(office: Office) -> None:
    office.end.shutdown(socket.SHUT_RDWR)
    office.server.close()
    assert office.process.poll() is None
