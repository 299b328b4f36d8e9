"""The progress of a sweep: a bar with the time left on a terminal, one line per run elsewhere."""

from __future__ import annotations

import shlex
import sys
import time
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import TextColumn
from rich.table import Table

from experiments.sweeps.plan import Run
from experiments.sweeps.results import RunResult
from experiments.sweeps.runner import SweepOutcome
from fogwatch.terminal.live_table import bar_on, duration_text

RESULT_OPTIONS = ("--out", "--workers", "--cluster")
"""Options that say where results are made and written, and change none."""


class SweepProgress:
    """Shows the progress of a sweep; a context manager that clears its bar away.

    It implements `experiments.sweeps.runner.SweepObserver`.
    """

    def __init__(
        self, console: Console, clock: Callable[[], float] = time.monotonic, assumed: Sequence[str] = ()
    ) -> None:
        """Make the bar, without showing it.

        `clock` gives the time in s. The lines `assumed` say what the runs hold for.
        """
        self._assumed = assumed
        self._console = console
        self._clock = clock
        self._begun = 0.0
        self._todo = self._there = self._made = 0
        self._bar = bar_on(console, TextColumn("{task.fields[left]}"))
        self._task = self._bar.add_task("runs", total=None, left="")

    @property
    def total(self) -> int:
        """The number of all runs."""
        return self._there + self._todo

    @property
    def done(self) -> int:
        """The number of runs that have a result, from this start or an earlier one."""
        return self._there + self._made

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def begin(self, todo: list[Run], done: list[RunResult], workers: int) -> None:
        """Print how many runs there are to make."""
        self._todo, self._there = len(todo), len(done)
        for line in self._assumed:
            self.say(line)
        done_text = f", {self._there} done already" if self._there else ""
        self.say(f"{self._todo} runs to make{done_text}; {workers} at a time")
        self._bar.update(self._task, total=self.total, completed=self.done)
        self._begun = self._clock()

    def result(self, result: RunResult) -> None:
        """Show that one more run is done."""
        self._made += 1
        remaining = self._time_left()
        self._bar.update(
            self._task, completed=self.done, description=f"{result.case} seed {result.seed}", left=remaining
        )
        if not result.ok:
            self.say(f"{result.case} seed {result.seed} failed: {result.error}")
        elif not self._console.is_terminal:
            mfow = result.metrics.get("mfow_mean_s")
            figure = "" if mfow is None else f"mean MFoW {mfow:.1f} s, "
            run = f"run {self.done} of {self.total}: {result.case}, seed {result.seed}"
            self.say(f"{run}: {figure}made in {result.wall_s:.1f} s; {remaining}")

    def say(self, text: str) -> None:
        """Print a line above the bar."""
        self._console.print(text, highlight=False, markup=False, soft_wrap=True)

    def _time_left(self) -> str:
        spent = self._clock() - self._begun
        return f"{duration_text(spent / self._made * (self._todo - self._made))} left"


def print_failures(console: Console, outcome: SweepOutcome) -> None:
    """Print the runs that failed, and a warning where some results are from another version."""
    if outcome.failed:
        table = Table("case", "seed", "why", box=None, pad_edge=False, header_style="red", title="failed runs")
        for column in table.columns:
            column.overflow = "fold"
        for run in outcome.failed:
            table.add_row(run.case, str(run.seed), run.error)
        console.print(table, highlight=False, markup=False)
        console.print("start again to repeat the failed runs", style="red")
    if outcome.other_software:
        versions = ", ".join(outcome.other_software)
        console.print(
            f"some results are from fogwatch {versions}; to repeat them with this version, choose a new --out",
            style="red",
        )


def command_line(*command: str) -> str:
    """Return this process's command line, for the pages that it writes, without options that change no result.

    If this process is another command than `command` (its words, such as "paper", "all"), those words are returned
    alone.
    """
    words = list(sys.argv[1:])
    if tuple(words[: len(command)]) != command:
        return shlex.join(["fogwatch", *command])
    for option in RESULT_OPTIONS:
        while option in words:
            index = words.index(option)
            del words[index : index + 2]
    words = [word for word in words if not word.startswith(tuple(f"{option}=" for option in RESULT_OPTIONS))]
    return shlex.join(["fogwatch", *words])
