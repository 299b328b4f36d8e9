"""A session of `fogwatch chaos`: it runs random scenarios, shows the progress, and writes those that break."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import TimeRemainingColumn

from experiments.chaos import (
    IN_ONE_PROCESS,
    KEY,
    Breakage,
    TimeLimit,
    TooSlow,
    Way,
    WayResult,
    examine,
    narrow,
    random_scenario,
)
from fogwatch.api import PACKAGES, RunOptions, execute
from fogwatch.launch.folder.runfolder import RunFolder
from fogwatch.launch.terminal.live_table import duration_text
from fogwatch.progress import bar_on
from patrol.errors import BadInput
from patrol.process.exit_codes import UNKNOWN
from patrol.process.starting.seldom import SELDOM
from patrol.process.starting.warmup import warm
from patrol.scenario import Scenario, dump_scenario

BROKEN = 1
"""The exit code when a scenario broke."""
MOST_NARROWED = 5
"""Scenarios that are reduced to fewer faults; further ones that break most likely have the same cause."""
PLAIN_S = 10.0
"""Wall time between two lines where there is no terminal."""
PROCESSES = "as processes"
"""The name of the way of running a scenario as a fleet of processes."""
KEY_FILE = "fleet.key"


class ChaosSession:
    """Runs scenarios, shows the progress, and writes those that break; a context manager around its progress bar."""

    def __init__(self, folder: Path, processes: bool, console: Console) -> None:
        """Check the folder.

        Args:
            folder: Where scenarios that break are written, and nothing else; empty, or not there yet.
            processes: Whether each scenario is run as a fleet of processes too.
            console: Where the progress is shown.

        Raises:
            BadInput: The folder is not empty or cannot be written to.
        """
        self._folder = folder
        self._processes = processes
        self._console = console
        self._broken: list[int] = []
        self._slow: list[int] = []
        self._begun = self._printed = time.monotonic()
        self._done = 0
        self._bar = bar_on(console, TimeRemainingColumn())
        self._task = self._bar.add_task("chaos", total=None)
        self._made = not folder.exists()
        try:
            if folder.is_dir() and any(folder.iterdir()):
                raise BadInput(f"--out {folder}: is not empty; choose a folder that is, or that does not exist yet")
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError as error:
            raise BadInput(f"--out {folder}: cannot be written ({error.strerror}); choose another folder") from None
        self._own = tempfile.TemporaryDirectory(prefix="fogwatch-chaos-")
        self._key = Path(self._own.name) / KEY_FILE
        self._key.write_bytes(KEY)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def begin(self, seed: int, runs: int) -> None:
        """Print what is about to run, and compile the kernels, so that no run has to wait for them.

        Args:
            seed: Seed of the first scenario.
            runs: Number of scenarios.
        """
        if not self._console.is_terminal:
            seeds = f"seed {seed}" if runs == 1 else f"seeds {seed} to {seed + runs - 1}"
            self._say(f"{_scenarios(runs)}, {seeds}, {self._ways_each} ...")
        warm(PACKAGES, self._say, SELDOM)

    def run(self, seed: int, runs: int) -> None:
        """Run one scenario in all ways.

        Args:
            seed: Its seed.
            runs: Number of scenarios in the session.
        """
        scenario = random_scenario(seed, self._key)
        self._bar.update(self._task, total=runs, completed=self._done, description=f"seed {seed}")
        try:
            breakage = examine(scenario, self._ways(self._folder / f"seed-{seed}"))
        except TooSlow as slow:
            self._slow.append(seed)
            self._say(f"seed {seed} is too slow to tell: {slow}")
            self._say(f"  {self._again(seed)}")
        else:
            if breakage is not None:
                self._broken.append(seed)
                self._report(seed, scenario, breakage)
        self._done += 1
        self._bar.update(self._task, completed=self._done)
        now = time.monotonic()
        if not self._console.is_terminal and now >= self._printed + PLAIN_S:
            self._printed = now
            left = (now - self._begun) / self._done * (runs - self._done)
            self._say(f"{self._done}/{runs}: {len(self._broken)} broke; {duration_text(left)} left")

    def tidy(self) -> None:
        """Remove the folder again if this session made it and nothing broke."""
        self._own.cleanup()
        if self._made and not any(self._folder.iterdir()):
            self._folder.rmdir()

    def close(self, runs: int) -> int:
        """Print the result of the session, which may have been interrupted.

        Args:
            runs: Number of scenarios in the session.

        Returns:
            The exit code.
        """
        spent = duration_text(time.monotonic() - self._begun)
        of = _scenarios(runs) if self._done == runs else f"{self._done} of {_scenarios(runs)}"
        counts = []
        if self._broken:
            counts.append(f"{len(self._broken)} broke")
        if self._slow:
            counts.append(f"{len(self._slow)} too slow to tell")
        seeds = [f"seeds {', '.join(map(str, self._broken + self._slow))}"] if counts else []
        if not counts:
            counts.append("all held" if self._done else "none has run")
        self._say(f"{of}, {self._ways_each}: {'; '.join([', '.join(counts) + f', in {spent}', *seeds])}")
        return BROKEN if self._broken else UNKNOWN if self._slow else 0

    @property
    def _ways_each(self) -> str:
        return f"{len(self._ways(None))} ways each"

    def _again(self, seed: int) -> str:
        return f"fogwatch chaos --runs 1 --seed {seed}{' --processes' if self._processes else ''}"

    def _ways(self, folder: Path | None) -> Mapping[str, Way]:
        return {**IN_ONE_PROCESS, **({PROCESSES: as_processes(folder)} if self._processes else {})}

    def _report(self, seed: int, scenario: Scenario, breakage: Breakage) -> None:
        """Print what broke, and write the scenario: as it was drawn first, then with fewer faults."""
        self._say(f"seed {seed} breaks: {breakage.kind}")
        self._say(
            f"  {breakage.detail.strip().splitlines()[-1]}" if breakage.detail.strip() else "  no details are known"
        )
        words = "as it was drawn"
        self._write(seed, scenario, breakage, words)
        self._mend_run_folder(seed, scenario)
        if len(self._broken) <= MOST_NARROWED:
            narrowed, words = self._narrowed(scenario, breakage)
            self._write(seed, narrowed, breakage, words)
        self._say(f"  {words}")
        if breakage.way:  # no single run shows that two ways differ
            self._say(f"  fogwatch run {self._file(seed)}{'' if breakage.way == PROCESSES else ' --in-process'}")
        self._say(f"  {self._again(seed)}")

    def _file(self, seed: int) -> Path:
        return self._folder / f"seed-{seed}.yaml"

    def _write(self, seed: int, scenario: Scenario, breakage: Breakage, words: str) -> None:
        """Write a scenario that breaks, and its key, if it has one, beside it."""
        text = f"seed {seed} of fogwatch chaos breaks: {breakage.kind}\n{breakage.detail}\n{words}"
        comment = "\n".join(f"# {line}".rstrip() for line in text.splitlines())
        self._file(seed).write_text(f"{comment}\n\n{dump_scenario(self._with_key(scenario))}", encoding="utf-8")

    def _mend_run_folder(self, seed: int, scenario: Scenario) -> None:
        """Let the scenario in a run folder that is kept name the key that is kept."""
        file = RunFolder(self._folder / f"seed-{seed}").scenario
        if file.exists():
            file.write_text(dump_scenario(self._with_key(scenario)), encoding="utf-8")

    def _with_key(self, scenario: Scenario) -> Scenario:
        """Copy the scenario's key, if it has one, to a file that is kept; return the scenario with it."""
        if scenario.radio.key is None:
            return scenario
        file = self._folder / KEY_FILE
        file.write_bytes(KEY)
        return scenario.model_copy(update={"radio": scenario.radio.model_copy(update={"key": str(file)})})

    def _narrowed(self, scenario: Scenario, breakage: Breakage) -> tuple[Scenario, str]:
        """Return the scenario with fewer faults, and a line that describes the reduction."""
        ways = IN_ONE_PROCESS if breakage.way in IN_ONE_PROCESS else self._ways(None)
        slow = 0

        def breaks(tried: Scenario) -> bool:
            nonlocal slow
            try:
                repeated = examine(tried, ways)
            except TooSlow:
                slow += 1
                return False
            return repeated is not None and repeated.kind == breakage.kind

        self._bar.update(self._task, description="fewer faults")
        if not breaks(scenario):
            return scenario, "as it was drawn; it does not break every time"
        narrowed = narrow(scenario, breaks)
        kinds = ", ".join(f"{fault.id} {fault.kind}" for fault in narrowed.kept) or "none"
        words = f"broke in the same way with {len(narrowed.kept)} of {len(scenario.faults)} faults: {kinds}"
        if slow:
            words += f"; {slow} tries were too slow to tell, so fewer may do"
        elif not narrowed.least:
            words += "; the limit of tries was reached, so fewer may do"
        if len(narrowed.scenario.faults) > len(narrowed.kept):
            words += "; clock faults without an effect keep the places of the others, and so their random draws"
        return narrowed.scenario, words

    def _say(self, line: str) -> None:
        self._console.print(line, highlight=False, markup=False, soft_wrap=True)


def as_processes(keep: Path | None) -> Way:
    """Make the way of running a scenario as a fleet of processes.

    Args:
        keep: Where the run folder is moved if the verdict is not valid or the run fails; None to discard it.

    Returns:
        The way, for `experiments.chaos.examine`.
    """

    def run(scenario: Scenario) -> WayResult:
        limit = TimeLimit()
        with tempfile.TemporaryDirectory(prefix="fogwatch-chaos-", ignore_cleanup_errors=True) as folder:
            out = Path(folder) / "run"
            options = RunOptions(out, begin=limit.begin, stop=limit.exceeded, picture=False)
            discard = False
            try:
                result = execute(scenario, options)
                limit.check(str(result.summary["ended"]))
                discard = result.verdict.valid
            except TooSlow:
                discard = True  # unknown, and nothing to look into
                raise
            except KeyboardInterrupt:
                discard = True
                limit.check("")
                raise
            finally:
                if not discard and keep is not None and out.exists():
                    shutil.move(out, keep)
        return WayResult(result.trace_hash, result.verdict, str(result.summary["ended"]))

    return run


def _scenarios(count: int) -> str:
    return "1 scenario" if count == 1 else f"{count} scenarios"
