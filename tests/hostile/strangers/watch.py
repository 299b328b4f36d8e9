"""What is watched while a stranger attacks a fleet: whether ticks go on, and how much memory its processes take."""

import os
from collections.abc import Callable, Iterator
from pathlib import Path

from fogwatch.terminal.live_table import RunDisplay
from runtime.messages.telemetry import Metrics

HUNG_S = 60.0
"""Wall time without a tick after which a run hangs; a busy machine takes seconds."""
START_S = 300.0
"""The same until the first tick."""
SETTLED_S = 20.0
"""How long the stranger waits, at most, for the fleet's processes to have what they need before the first tick."""
MOST_GROWTH_MB = 300.0
"""How much more memory a process may take than when the stranger began; a whole process of a fleet takes less."""
SAMPLE_S = 1.0

_PROC = Path("/proc")


class Progress(RunDisplay):
    """A display of a run that keeps what it is shown, and shows nothing.

    Attributes:
        ticks: Ticks done.
        longest_s: The longest wall time between two ticks, s, as far as it was shown.
        lines: What it was told in words.
    """

    def __init__(self, now: Callable[[], float]) -> None:
        self.ticks = 0
        self.longest_s = 0.0
        self.lines: list[str] = []
        self._now = now
        self._moved = now()

    def say(self, line: str) -> None:
        """Keep a line."""
        self.lines.append(line)

    def metrics(self, metrics: Metrics) -> None:
        """Keep how far the run has come."""
        if metrics.k > self.ticks:
            if self.ticks:
                self.longest_s = max(self.longest_s, self.stalled_s)
            self.ticks = metrics.k
            self._moved = self._now()

    def begin(self) -> None:
        """The ticks are about to begin."""
        self._moved = self._now()

    @property
    def stalled_s(self) -> float:
        """Wall time since the last tick, s."""
        return self._now() - self._moved

    @property
    def hung(self) -> bool:
        """Whether there has been no tick for too long."""
        return self.stalled_s > (HUNG_S if self.ticks else START_S)


class Memory:
    """How much more memory the children of this process take than when the stranger began.

    Attributes:
        growth_mb: The most by name, MB. A process that began after the stranger counts from its own beginning.
    """

    def __init__(self, now: Callable[[], float], parent: int | None = None) -> None:
        self.growth_mb: dict[str, float] = {}
        self._now = now
        self._parent = os.getpid() if parent is None else parent
        self._start_mb: dict[int, float] = {}
        self._due = 0.0

    def settle(self, rest: Callable[[float], None], over: Callable[[], bool]) -> None:
        """Wait until no child has grown for `SAMPLE_S`; from now on growth counts. The stranger has to come later."""
        until, before = self._now() + SETTLED_S, {0: 0.0}
        while self._start_mb != before and self._now() < until and not over():
            rest(SAMPLE_S)
            before, self._start_mb = self._start_mb, {number: mb for number, _, mb in self._children(0)}

    def look(self, but: int) -> None:
        """Look at all children, at most every `SAMPLE_S`; where there is no proc(5), at none."""
        now = self._now()
        if now < self._due:
            return
        self._due = now + SAMPLE_S
        for number, name, peak_mb in self._children(but):
            grown = peak_mb - self._start_mb.setdefault(number, peak_mb)
            self.growth_mb[name] = max(self.growth_mb.get(name, 0.0), grown)

    def _children(self, but: int) -> Iterator[tuple[int, str, float]]:
        """Number, name and peak (MB) of each child but one."""
        for folder in _PROC.glob("[0-9]*"):
            number = int(folder.name)
            try:
                if number == but or _parent_of(folder) != self._parent:
                    continue
                peak_mb, name = _peak_mb(folder), _name(folder)
            except (OSError, ValueError, IndexError, KeyError):
                continue  # it has ended
            yield number, name, peak_mb


def _parent_of(folder: Path) -> int:
    return int((folder / "stat").read_bytes().rpartition(b")")[2].split()[1])


def _peak_mb(folder: Path) -> float:
    lines = (folder / "status").read_text(encoding="utf-8", errors="replace").splitlines()
    fields = dict(line.partition(":")[::2] for line in lines)
    return int(fields["VmHWM"].split()[0]) / 1024.0


def _name(folder: Path) -> str:
    """The robot's name or the module that a process of ours was started with."""
    words = (folder / "cmdline").read_bytes().decode(errors="replace").split("\0")
    return words[words.index("--robot" if "--robot" in words else "-m") + 1]
