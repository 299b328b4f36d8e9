"""The hunt for scenarios that break: runs them, shows how far it is, and writes down what it finds."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from experiments.chaos import IN_ONE_PROCESS, KEY, LIMIT_S, Breakage, Ran, Way, examine, narrow, random_scenario
from fogwatch.api import Wishes, execute
from fogwatch.progress import duration
from patrol.errors import BadInput
from patrol.scenario import Scenario, dump_scenario

BROKEN = 1
"""The exit code when something did not hold."""
MOST_NARROWED = 5
"""Scenarios that fewer faults are looked for; of more that break, the reason is most likely the same."""
PLAIN_S = 10.0
PROCESSES = "as processes"


class Hunt:
    """Runs scenarios, shows how far it is, and writes down what breaks; a context manager around its bar."""

    def __init__(self, folder: Path, processes: bool, console: Console) -> None:
        self._folder = folder
        self._processes = processes
        self._console = console
        self._broken: list[int] = []
        self._begun = self._told = time.monotonic()
        self._done = 0
        self._bar = Progress(
            TextColumn("{task.description}", style="cyan"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=console,
            transient=True,
        )
        self._task = self._bar.add_task("chaos", total=None)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._key.write_bytes(KEY)
        except OSError as error:
            raise BadInput(f"--out {folder}: cannot be written ({error.strerror}); choose another folder") from None

    @property
    def _key(self) -> Path:
        return self._folder / "fleet.key"

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            self._bar.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if self._console.is_terminal:
            self._bar.stop()

    def run(self, seed: int, runs: int) -> None:
        """Run one scenario in all ways."""
        scenario = random_scenario(seed, self._key)
        self._bar.update(self._task, total=runs, completed=self._done, description=f"seed {seed}")
        found = examine(scenario, self._ways(self._folder / f"seed-{seed}"))
        if found is not None:
            self._broken.append(seed)
            self._report(seed, scenario, found)
        self._done += 1
        self._bar.update(self._task, completed=self._done)
        now = time.monotonic()
        if not self._console.is_terminal and now >= self._told + PLAIN_S:
            self._told = now
            left = (now - self._begun) / self._done * (runs - self._done)
            self._say(f"{self._done}/{runs}: {len(self._broken)} broke; {duration(left)} left")

    def tidy(self) -> None:
        """Leave no folder behind where nothing broke."""
        if not self._broken:
            self._key.unlink(missing_ok=True)
            if not any(self._folder.iterdir()):
                self._folder.rmdir()

    def close(self, runs: int) -> int:
        """Say what it came to; the exit code."""
        ways = f"{len(self._ways(self._folder))} ways each"
        spent = duration(time.monotonic() - self._begun)
        if not self._broken:
            self._say(f"{runs} scenarios, {ways}: all held, in {spent}")
            return 0
        seeds = ", ".join(map(str, self._broken))
        self._say(f"{runs} scenarios, {ways}: {len(self._broken)} broke, in {spent}; seeds {seeds}")
        return BROKEN

    def _ways(self, folder: Path) -> Mapping[str, Way]:
        return {**IN_ONE_PROCESS, **({PROCESSES: as_processes(folder)} if self._processes else {})}

    def _report(self, seed: int, scenario: Scenario, found: Breakage) -> None:
        """Say what broke, and write it down with as few faults as break it."""
        self._say(f"seed {seed} breaks: {found.kind}")
        self._say(f"  {found.detail.strip().splitlines()[-1]}" if found.detail.strip() else "  nothing more is known")
        narrowed, words = scenario, "as it was drawn"
        if len(self._broken) <= MOST_NARROWED:
            narrowed, words = self._narrowed(scenario, found)
        file = self._folder / f"seed-{seed}.yaml"
        text = f"seed {seed} of fogwatch chaos breaks: {found.kind}\n{found.detail}\n{words}"
        comment = "\n".join(f"# {line}".rstrip() for line in text.splitlines())
        file.write_text(f"{comment}\n\n{dump_scenario(narrowed)}", encoding="utf-8")
        self._say(f"  {words}")
        self._say(f"  fogwatch run {file}{'' if PROCESSES in found.kind else ' --in-process'}")
        self._say(f"  fogwatch chaos --runs 1 --seed {seed}{' --processes' if self._processes else ''}")

    def _narrowed(self, scenario: Scenario, found: Breakage) -> tuple[Scenario, str]:
        """The scenario with fewer faults, and what to say of that."""
        in_one = {name for name in IN_ONE_PROCESS if found.kind.startswith(f"{name}:")}
        with tempfile.TemporaryDirectory(prefix="fogwatch-chaos-") as folder:
            ways = IN_ONE_PROCESS if in_one else self._ways(Path(folder) / "run")

            def breaks(tried: Scenario) -> bool:
                again = examine(tried, ways)
                return again is not None and again.kind == found.kind

            self._bar.update(self._task, description="fewer faults")
            if not breaks(scenario):
                return scenario, "it does not break every time"
            narrowed = narrow(scenario, breaks)
        kinds = ", ".join(f"{fault.id} {fault.kind}" for fault in narrowed.faults) or "none"
        return narrowed, f"faults that it takes, {len(narrowed.faults)} of {len(scenario.faults)}: {kinds}"

    def _say(self, line: str) -> None:
        self._console.print(line, highlight=False, markup=False, soft_wrap=True)


def as_processes(folder: Path) -> Way:
    """The way of running a scenario as a fleet of processes. Its run folder is taken away again if all is well."""

    def run(scenario: Scenario) -> Ran:
        shutil.rmtree(folder, ignore_errors=True)
        end = time.monotonic() + LIMIT_S
        result = execute(scenario, Wishes(folder, stop=lambda: time.monotonic() > end, draw=False))
        if result.verdict.valid:
            shutil.rmtree(folder, ignore_errors=True)
        return Ran(result.trace_hash, result.verdict, str(result.summary["ended"]))

    return run
