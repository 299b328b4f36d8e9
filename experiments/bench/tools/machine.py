"""The machine that a benchmark runs on, and whether it has other things to do."""

from __future__ import annotations

import os
import platform
import subprocess
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

import experiments
from experiments.sweeps.pool import cores

BUSY_LOAD = 0.3
"""The share of the machine above which the load before a benchmark foretells that others' work will disturb it."""

BUSY_SHARE = 0.1
"""The share of the machine above which others' work disturbs a benchmark while it runs."""

CAUTION = (
    "processor times differ by up to a third from run to run, ratios by less; wall times, and figures of several "
    "processes, by more"
)

ROOT = Path(experiments.__file__).resolve().parents[1]


@dataclass(frozen=True, slots=True)
class Machine:
    """What a benchmark's figures depend on besides the code.

    Attributes:
        processor: The model's name.
        cores: Number of cores that this process may use.
        memory_gb: Memory, 10^9 bytes.
        system: Kernel and machine type.
        python: Version.
        numba: Version.
        fogwatch: Version.
        commit: Of the source, shortened, with ``+`` where files have been changed since; empty where there is no
            repository.
        when: UTC, to the minute.
        load: Average number of processes that wanted a core in the minute before the benchmark.
    """

    processor: str
    cores: int
    memory_gb: float
    system: str
    python: str
    numba: str
    fogwatch: str
    commit: str
    when: str
    load: float

    @property
    def busy(self) -> bool:
        """Whether the load before the benchmark foretells that others' work will disturb it."""
        return self.load > BUSY_LOAD * self.cores

    @property
    def warning(self) -> str:
        """A line that warns before the benchmark; empty where there is nothing to warn of."""
        if not self.busy:
            return ""
        return (
            f"this machine is busy: load {self.load:.1f} on {self.cores} cores. Beside other work {CAUTION}. Measure "
            "when it is quiet."
        )

    def doubts(self, others: float | None) -> str:
        """A line that warns of what was measured beside others' work; empty where there is nothing to warn of.

        Args:
            others: The most cores that others kept busy meanwhile; None where nobody counted, so that the load before
                is all there is to go by.
        """
        if others is None:
            work = f"load {self.load:.1f} on {self.cores} cores before" if self.busy else ""
        else:
            work = f"up to {others:.1f} of {self.cores} cores" if others > BUSY_SHARE * self.cores else ""
        return f"measured beside other work ({work}): {CAUTION}" if work else ""

    @property
    def lines(self) -> list[str]:
        """The machine in two lines."""
        source = f"fogwatch {self.fogwatch}{f' at {self.commit}' if self.commit else ''}"
        return [
            f"{self.processor}, {self.cores} cores, {self.memory_gb:.0f} GB, {self.system}",
            f"{source}, Python {self.python}, numba {self.numba}, {self.when}, load before {self.load:.2f}",
        ]


def this_machine() -> Machine:
    """The machine that this process runs on, as it is now."""
    pages = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return Machine(
        processor=_processor(),
        cores=cores(),
        memory_gb=pages / 1e9,
        system=f"{platform.system()} {platform.machine()}",
        python=platform.python_version(),
        numba=metadata.version("numba"),
        fogwatch=metadata.version("fogwatch"),
        commit=_commit(),
        when=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        load=os.getloadavg()[0],
    )


def _processor() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        text = ""
    models = [line.partition(":")[2].strip() for line in text.splitlines() if line.startswith("model name")]
    return models[0] if models else platform.processor() or "unknown processor"


def _commit() -> str:
    def git(*words: str) -> str:
        done = subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, text=True, check=False)
        return done.stdout.strip() if done.returncode == 0 else ""

    try:
        if git("rev-parse", "--show-toplevel") != str(ROOT):
            return ""  # somebody else's repository, in which fogwatch is installed
        changed = "+" if git("status", "--porcelain", "--untracked-files=no") else ""
        return f"{git('rev-parse', '--short', 'HEAD')}{changed}"
    except FileNotFoundError:
        return ""
