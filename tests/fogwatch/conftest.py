"""Runs as processes of their own, and what tests want to know of them."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import pytest

import fogwatch
from patrol.journal import RobotTick, TickRecord, read_journal
from tests.fleets import trace_of

PATIENCE_S = 800.0
"""How long anything may take, s, on a machine with much else to do: less than pytest's own limit."""

WITHOUT = ("--no-page", "--no-picture", "--no-recording", "--no-report")
"""What no run has unless a test asks for it: most of a short run's time goes into these."""


class Run:
    """A ``fogwatch run`` as a process, its children found by what they were started with."""

    def __init__(self, scenario: dict[str, Any], folder: Path, *arguments: str) -> None:
        folder.mkdir()
        self.file = folder / "given.yaml"
        self.file.write_text(json.dumps(scenario), encoding="utf-8")
        self.folder = folder / "run"
        command = [sys.executable, "-P", "-m", "fogwatch", "run", str(self.file), "--out", str(self.folder)]
        command += [*WITHOUT, *arguments]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def children(self) -> dict[str, int]:
        """Process ids by name."""
        found = {}
        for entry in Path("/proc").glob("[0-9]*"):
            try:
                words = (entry / "cmdline").read_bytes().decode().split("\0")
                state, parent = self._state_and_parent(entry)
            except OSError:
                continue
            if state == "Z":
                continue
            ours = any(word.startswith(f"{self.folder}/") for word in words)
            if "-m" not in words or not (ours or "fogwatch.router" in words):
                continue
            if "fogwatch.router" in words and parent != self.process.pid:
                continue
            name = words[words.index("--robot") + 1] if "--robot" in words else words[words.index("-m") + 1]
            found[name] = int(entry.name)
        return found

    def fork_server(self) -> int:
        """Process id of what makes the agents."""
        for entry in Path("/proc").glob("[0-9]*"):
            with suppress(OSError):
                words = (entry / "cmdline").read_bytes().decode().split("\0")
                if "agent.fork_server" in words and self._state_and_parent(entry)[1] == self.process.pid:
                    return int(entry.name)
        pytest.fail("there is no fork server")

    def _state_and_parent(self, entry: Path) -> tuple[str, int]:
        """A process's state and its parent's id, by proc(5). Raises OSError when it has gone."""
        state, parent, *_ = (entry / "stat").read_text().rpartition(")")[2].split()
        return state, int(parent)

    def unread(self, pid: int) -> int:
        """Bytes that have come over TCP for a process and that it has not read."""
        held = {str(entry.readlink()) for entry in Path(f"/proc/{pid}/fd").iterdir()}
        rows = [row.split() for row in Path(f"/proc/{pid}/net/tcp").read_text(encoding="ascii").splitlines()[1:]]
        return sum(int(row[4].partition(":")[2], 16) for row in rows if f"socket:[{row[9]}]" in held)

    def ticks(self) -> int:
        try:
            return (self.folder / "ticks.csv").read_text(encoding="ascii").count("\n") - 1
        except OSError:
            return 0

    def until(self, what: Callable[[], bool], limit_s: float = PATIENCE_S) -> None:
        """Wait for something to become true; if it does not, say what the run was doing instead."""
        end = time.monotonic() + limit_s
        while not what():
            if time.monotonic() >= end:
                ticks, children = self.ticks(), sorted(self.children())
                self.process.kill()
                pytest.fail(f"waited in vain; {ticks} ticks, {children}, {self.process.communicate()[1][-4000:]}")
            time.sleep(0.02)  # the run is to have the processors

    def end(self) -> int:
        """Wait for the end; the exit code."""
        self.output, self.errors = self.process.communicate(timeout=PATIENCE_S)
        return self.process.returncode

    def pass_ticks(self, ticks: int) -> None:
        before = self.ticks()
        self.until(lambda: self.ticks() >= before + ticks)

    def interrupt(self) -> None:
        """Interrupt the run, as Ctrl-C does, and wait for its end."""
        self.process.send_signal(signal.SIGINT)
        assert self.end() == 130, self.errors

    def assert_undisturbed(self) -> None:
        """Assert that the run is valid, and that its trace is that of as many ticks in one process."""
        summary = self.summary()
        assert summary["verdict"]["valid"], summary["verdict"]
        assert summary["trace_hash"] == trace_of(self.file, summary["ticks"], self.folder.parent)

    def assert_replayed(self) -> None:
        """Assert that the run is valid, and that its timeline as a scenario leaves its trace."""
        summary = self.summary()
        assert summary["verdict"]["valid"], summary["verdict"]
        length = {"duration": summary["ticks"] * 0.5}
        again = fogwatch.run(
            self.folder / "timeline.yaml", out=self.folder.parent / "again", overrides=length, picture=False
        )
        assert again.verdict.valid, again.verdict.failed
        assert again.trace_hash == summary["trace_hash"]

    def failed(self) -> dict[str, str]:
        """The details of the checks that failed, by name."""
        return {check["name"]: check["detail"] for check in self.summary()["verdict"]["checks"] if not check["ok"]}

    def statuses(self) -> dict[str, str]:
        """The robots' statuses in the end, by name."""
        return {name: facts["status"] for name, facts in self.summary()["robots"].items()}

    def records(self, first: int = 0) -> list[TickRecord]:
        """The ticks so far, from the first on."""
        return list(read_journal(self.folder / "journal").ticks)[first:]

    def rows(self, number: int, first: int = 0) -> list[RobotTick]:
        """A robot's part of them."""
        return [record.robots[number - 1] for record in self.records(first)]

    def summary(self) -> dict[str, Any]:
        summary: dict[str, Any] = json.loads((self.folder / "summary.json").read_text(encoding="utf-8"))
        return summary


class Said(NamedTuple):
    """The exit code of a command, and what it has printed."""

    code: int
    out: str
    err: str


Shell = Callable[..., Said]
Refused = Callable[..., str]


@pytest.fixture
def shell(fogwatch: Callable[..., int], capsys: pytest.CaptureFixture[str]) -> Shell:
    """The command in this process, with what it prints."""

    def run(*words: str | Path) -> Said:
        code = fogwatch(*words)
        return Said(code, *capsys.readouterr())

    return run


@pytest.fixture
def refused(shell: Shell) -> Refused:
    """The command where it is bad input: the one line that is all it says."""

    def run(*words: str | Path) -> str:
        said = shell(*words)
        assert (said.code, said.out, said.err.count("\n")) == (2, "", 1), said
        return said.err

    return run


def cut_off(run: Path, folder: Path, share: float = 2 / 3) -> Path:
    """Copy a run as if it had been killed after a share of its journal."""
    folder.mkdir()
    (folder / "scenario.yaml").write_bytes((run / "scenario.yaml").read_bytes())
    whole = (run / "journal").read_bytes()
    (folder / "journal").write_bytes(whole[: int(share * len(whole))])
    return folder


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Run]]:
    """Starts runs, and ends them with everything that they have started."""
    runs: list[Run] = []

    def begin(scenario: dict[str, Any], *arguments: str) -> Run:
        runs.append(Run(scenario, tmp_path / f"run-{len(runs)}", *arguments))
        return runs[-1]

    yield begin
    for run in runs:
        for pid in [*run.children().values(), *([run.process.pid] if run.process.poll() is None else [])]:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        run.process.communicate(timeout=PATIENCE_S)
