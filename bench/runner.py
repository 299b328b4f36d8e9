"""The runner of all scripts: one of pyperf that measures processor time and passes its options to its workers."""

from __future__ import annotations

import argparse
import subprocess
import time
from collections.abc import Callable, Mapping
from functools import cache
from importlib import metadata
from pathlib import Path

import pyperf

from runtime.starting.warmup import SELDOM, warm

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("patrol", "agent", "worldsim")
"""Packages whose kernels are compiled before anything is measured."""


class Bench:
    """The benchmarks of one script.

    pyperf runs the script once, and then once more for each process in which it measures one benchmark. So a script
    names its benchmarks always in the same order, and prepares one only when it is measured.

    Attributes:
        worker: Whether this process measures, rather than starts those that do.
    """

    def __init__(
        self,
        script: str,
        *,
        processes: int = 5,
        values: int = 3,
        warmups: int = 1,
        loops: int = 0,
        min_time_s: float = 0.1,
        options: Mapping[str, int] | None = None,
    ) -> None:
        """Read the command line, and compile the kernels.

        Args:
            script: The name of the module in this folder.
            processes: Processes for each benchmark, unless the command line says otherwise.
            values: Values for each process.
            warmups: Values before them that do not count.
            loops: Calls for each value; 0 for as many as `min_time_s` needs.
            min_time_s: What a value takes at least, s.
            options: Names and defaults of the script's own options, which are whole numbers.
        """
        self._names = ("only", *(options or {}))
        self._runner = pyperf.Runner(
            processes=processes,
            values=values,
            warmups=warmups,
            loops=loops,
            min_time=min_time_s,
            program_args=("-m", f"bench.{script}"),
            add_cmdline_args=self._pass_on,
            metadata={
                "fogwatch_version": metadata.version("fogwatch"),
                "fogwatch_commit": commit(),
                "numba_version": metadata.version("numba"),
            },
        )
        parser = self._runner.argparser
        parser.add_argument("--only", default="", metavar="TEXT", help="only benchmarks whose name contains this")
        for name, default in (options or {}).items():
            parser.add_argument(f"--{name}", type=int, default=default, metavar="N", help=f"(default: {default})")
        parser.set_defaults(copy_env=True)  # where compiled kernels are kept may be said there
        self._options = self._runner.parse_args()
        self.worker = bool(self._options.worker)
        self._others: list[str] = []
        self._any_chosen = False
        if not self.worker:
            warm(PACKAGES, print, SELDOM)

    def option(self, name: str) -> int:
        """Return the value of one of the script's own options.

        Args:
            name: Its name.
        """
        return int(getattr(self._options, name))

    def measure(self, name: str, begin: Callable[[], Callable[[], object]], note: str = "") -> None:
        """Measure the processor time of a call.

        Args:
            name: Of the benchmark.
            begin: Prepares, and returns the call.
            note: What else there is to say about the result.
        """
        self.time(name, processor_time(begin), note=note)

    def time(
        self,
        name: str,
        time_func: Callable[[int], float],
        *,
        inner_loops: int = 1,
        unit: str = "second",
        note: str = "",
    ) -> None:
        """Measure what a function returns.

        Args:
            name: Of the benchmark.
            time_func: Takes a number of loops, and returns what all of them took.
            inner_loops: What each loop does so many times.
            unit: Of what it returns: ``second`` or ``byte``.
            note: What else there is to say about the result.
        """
        if self._options.only.lower() in name.lower():
            self._any_chosen = True
            facts = {"unit": unit, "note": note} if note else {"unit": unit}
            self._runner.bench_time_func(name, time_func, inner_loops=inner_loops, metadata=facts)
        else:
            self._others.append(name)

    def end(self) -> None:
        """Exit with 2 where no name of a benchmark contains what ``--only`` says; called after the last benchmark."""
        if not self._any_chosen:
            names = "; ".join(self._others)
            self._runner.argparser.error(f"--only {self._options.only}: no benchmark has this in its name: {names}")

    def _pass_on(self, command: list[str], options: argparse.Namespace) -> None:
        command.extend(f"--{name}={getattr(options, name)}" for name in self._names)


def processor_time(begin: Callable[[], Callable[[], object]]) -> Callable[[int], float]:
    """Return a function that measures the processor time of calls, of all threads of this process together.

    Args:
        begin: Prepares, and returns the call; called once, when the function is called first.

    Returns:
        Takes the number of calls, and returns what they took, s.
    """
    prepare = cache(begin)

    def time_func(loops: int) -> float:
        call = prepare()
        begun_s = time.process_time()
        for _ in range(loops):
            call()
        return time.process_time() - begun_s

    return time_func


def commit() -> str:
    """Return the commit of this clone, with a plus sign where files have changed since; empty where git cannot tell."""
    command = ["git", "-C", str(ROOT), "describe", "--always", "--dirty=+", "--exclude=*"]
    try:
        result = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        return ""
    return result.stdout.strip()
