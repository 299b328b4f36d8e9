"""Runs a spell: a fleet as processes, and its stranger, which begins before the ticks and is killed after the run."""

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from fogwatch.api import RunOptions, execute
from fogwatch.inprocess import run_in_process
from fogwatch.launch.launcher import LaunchFailed
from fogwatch.notebook.run import Run
from fogwatch.run_folder.runfolder import RunFolder
from patrol.errors import BadInput, printable
from tests.hostile.strangers.judge import BEGUN, Seen
from tests.hostile.strangers.spell import Spell
from tests.hostile.strangers.watch import Memory, Progress

RESUME_S = 3.0
"""How long a stranger that has stopped reading stands still."""
FIRST_S = 60.0
"""How long the ticks wait for a stranger's first attack, s; without one the fleet counts as not attacked."""
POLL_S = 0.02
_DIED = "starting it again"
_TRACEBACK = "Traceback (most recent call last)"


class Stranger:
    """The process of a stranger."""

    def __init__(self, spell: Spell, run: Path, log: Path, now: Callable[[], float]) -> None:
        self._spell = spell
        self._run = run
        self._log = log
        self._now = now
        self._process: subprocess.Popen[bytes] | None = None
        self._lifeline = (-1, -1)
        self._resume_at: float | None = None

    @property
    def pid(self) -> int:
        """Its process id; 0 before its start."""
        return 0 if self._process is None else self._process.pid

    def start(self) -> None:
        """Start it; the run's router must be there."""
        self._lifeline = os.pipe()
        robots = ",".join(robot.name for robot in self._spell.scenario.roster)
        command = [sys.executable, "-P", "-m", "tests.hostile.strangers.stranger", "--run", str(self._run)]
        command += ["--robots", robots, "--holds", self._spell.holds.name, "--victim", self._spell.victim]
        command += ["--seed", str(self._spell.seed), "--lifeline", str(self._lifeline[0])]
        for attack in self._spell.only:
            command += ["--only", attack]
        with self._log.open("wb") as output:
            streams: dict[str, Any] = {"stdin": subprocess.DEVNULL, "stdout": output, "stderr": subprocess.STDOUT}
            inherited = [self._lifeline[0]]
            self._process = subprocess.Popen(command, **streams, pass_fds=inherited, start_new_session=True)

    def wait(self, over: Callable[[], bool]) -> None:
        """Wait until it begins its first attack, or has ended."""
        until = self._now() + FIRST_S
        while self._process is not None and self._process.poll() is None and self._now() < until and not over():
            if read_log(self._log)[0]:
                return
            time.sleep(POLL_S)

    def look(self) -> None:
        """Let it go on if it has stood still for `RESUME_S`."""
        process = self._process
        if process is None or process.returncode is not None:
            return
        if self._resume_at is None:
            try:
                stopped = os.waitid(os.P_PID, process.pid, os.WSTOPPED | os.WNOHANG)
            except ChildProcessError:  # it has ended
                return
            self._resume_at = None if stopped is None else self._now() + RESUME_S
        elif self._now() >= self._resume_at:
            self._resume_at = None
            process.send_signal(signal.SIGCONT)

    def end(self) -> tuple[Counter[str], Counter[str], str]:
        """Kill it; return its attacks by name, what came of them, and why it had ended by itself, if it had."""
        why = ""
        if self._process is not None:
            if self._process.poll() is not None:
                why = f"it ended with exit code {self._process.returncode}"
            self._process.kill()
            self._process.wait()
        for end in self._lifeline:
            if end >= 0:
                os.close(end)
        self._lifeline = (-1, -1)
        attacks, counts, rest = read_log(self._log)
        return attacks, counts, f"{why}: {rest}" if why and rest else why


def read_log(log: Path) -> tuple[Counter[str], Counter[str], str]:
    """What a stranger has reported: its attacks by name, what came of them, and the last line that is no report."""
    attacks: Counter[str] = Counter()
    counts: Counter[str] = Counter()
    rest = ""
    for line in log.read_text(encoding="utf-8", errors="replace").splitlines() if log.exists() else []:
        try:
            says = json.loads(line)
            if "begins" in says:
                attacks[says["begins"]] += 1
                counts[BEGUN] += 1
            if "attack" in says:
                counts += Counter(says["counts"])
        except (ValueError, TypeError):
            rest = printable(line.strip()) or rest
    return attacks, counts, rest


def run_spell(spell: Spell, folder: Path, over: Callable[[], bool]) -> tuple[Seen, Counter[str]]:
    """Run a spell, with its run and the stranger's log in a new folder; what was seen, and the attacks by name."""
    folder.mkdir(parents=True, exist_ok=True)
    out, now = folder / "run", time.monotonic
    progress, memory = Progress(now), Memory(now)
    stranger = Stranger(spell, out, folder / "stranger.log", now)

    def begin() -> None:
        memory.settle(time.sleep, over)
        stranger.start()
        stranger.wait(over)
        progress.begin()

    def stop() -> bool:
        stranger.look()
        memory.look(but=stranger.pid)
        return progress.hung or over()

    result: Run | None = None
    ended = ""
    try:
        bare = RunOptions(out, picture=False, recording=False, report=False, page=spell.page)
        options = replace(bare, display=progress, begin=begin, stop=stop)
        result = execute(spell.scenario, options)
    except (BadInput, LaunchFailed) as error:
        ended = f"{type(error).__name__}: {error}"
    except KeyboardInterrupt:
        if over() or not progress.hung:
            raise
    finally:
        attacks, counts, why = stranger.end()
    if over():
        raise KeyboardInterrupt
    if progress.hung:
        ended = f"hung: no tick for {progress.stalled_s:.0f} s after tick {progress.ticks}"
    logs = RunFolder(out).logs
    said = {log.name: log.read_text(encoding="utf-8", errors="replace") for log in sorted(logs.glob("*"))}
    seen = Seen(
        ended=ended or ("" if result is None else str(result.summary["ended"])),
        outcome="" if result is None else result.verdict.outcome,
        failed={} if result is None else {check.name: check.detail for check in result.verdict.failed},
        trace="" if result is None else result.trace_hash,
        honest=honest_trace(spell) if result is not None and spell.lockstep else "",
        restarts=[printable(line) for line in progress.lines if _DIED in line],
        crashes=[name for name, text in said.items() if _TRACEBACK in text],
        growth_mb=memory.growth_mb,
        counts=counts,
        ticks=progress.ticks if result is None else int(result.summary["ticks"]),
        longest_s=progress.longest_s,
        stranger=why,
    )
    return seen, attacks


def honest_trace(spell: Spell) -> str:
    """The trace hash of a spell's scenario without a stranger, run in this process."""
    return str(run_in_process(spell.scenario, keep=False).summary.trace_hash)
