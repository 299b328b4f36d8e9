"""What the kernel says about processes: their memory, their processor time, and what they have sent."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path

from experiments.bench.tools.measure import Unmeasured

PROC = Path("/proc")
_KIB = 1024
_BUSY = (0, 1, 2, 5, 6, 7)
"""Where a core's line has its busy time: user, nice, system, irq, softirq, steal; between them idle and iowait."""


@dataclass(frozen=True, slots=True)
class Memory:
    """The resident memory of a process, 10^6 bytes.

    Attributes:
        rss: All of it.
        pss: The same, with each page that several processes map divided among them.
        private: What nobody else maps.
    """

    rss: float
    pss: float
    private: float


@dataclass(frozen=True, slots=True)
class Process:
    """A process as it is now.

    Attributes:
        pid: Its number.
        parent: That of its parent.
        words: Its command line.
        began: When it was started, s on the clock of `since_boot`.
        processor: Processor time so far, s, children that have ended not included.
    """

    pid: int
    parent: int
    words: tuple[str, ...]
    began: float
    processor: float


def memory_of(pid: int) -> Memory:
    """The memory of a process.

    Args:
        pid: Its number.

    Raises:
        Unmeasured: There is no such process any more, or the kernel does not say.
    """
    path = PROC / str(pid) / "smaps_rollup"
    found: dict[str, float] = {}
    try:
        for line in _text(path).splitlines()[1:]:
            name, _, rest = line.partition(":")
            found[name] = float(rest.split()[0]) * _KIB / 1e6
        return Memory(found["Rss"], found["Pss"], found["Private_Clean"] + found["Private_Dirty"])
    except (KeyError, IndexError, ValueError):  # empty for a process that is just ending
        raise Unmeasured(f"{path}: does not say all of the process's memory") from None


def peak_mb() -> float:
    """The peak of this process's resident memory, 10^6 bytes.

    Unlike `resource.getrusage`, this does not begin with what the parent had when it started this process.

    Raises:
        Unmeasured: The kernel does not say.
    """
    for line in _text(PROC / "self" / "status").splitlines():
        if line.startswith("VmHWM:"):
            return float(line.split()[1]) * _KIB / 1e6
    raise Unmeasured("this kernel keeps no peak of a process's memory")


def family_of(pid: int) -> list[Process]:
    """A process and all that descend from it, as far as they live.

    Args:
        pid: Its number.
    """
    numbers = [int(path.name) for path in PROC.iterdir() if path.name.isdecimal()]
    every = [process for number in numbers if (process := _process(number)) is not None]
    family = {pid}
    grown = True
    while grown:
        grown = False
        for process in every:
            if process.parent in family and process.pid not in family:
                family.add(process.pid)
                grown = True
    return [process for process in every if process.pid in family]


def since_boot() -> float:
    """The time on the clock that processes' beginnings are told by, s."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


def loopback_bytes() -> int:
    """Bytes that this machine has sent to itself so far, headers of TCP and IP included.

    Raises:
        Unmeasured: The kernel does not say.
    """
    for line in _text(PROC / "net" / "dev").splitlines():
        name, _, rest = line.partition(":")
        if name.strip() == "lo":
            return int(rest.split()[8])
    raise Unmeasured("there is no loopback interface to count on")


def cores_busy_s() -> float:
    """For how long the cores that this process may use have been busy since the machine was started, all together, s.

    Interrupts count, and so does time that a hypervisor gave to others while a core had work to do.

    Raises:
        Unmeasured: The kernel does not say.
    """
    path = PROC / "stat"
    lines = {line.partition(" ")[0]: line.split()[1:] for line in _text(path).splitlines()}
    try:
        ticks = [[int(word) for word in lines[f"cpu{core}"]] for core in os.sched_getaffinity(0)]
        busy = sum(sum(spent[place] for place in _BUSY) for spent in ticks)
    except (KeyError, IndexError, ValueError):
        raise Unmeasured(f"{path}: does not say for how long each core was busy") from None
    return busy / os.sysconf("SC_CLK_TCK")


def _process(pid: int) -> Process | None:
    try:
        stat = _text(PROC / str(pid) / "stat")
        words = _text(PROC / str(pid) / "cmdline")
    except Unmeasured:
        return None  # it has ended
    fields = stat.rpartition(")")[2].split()
    per_s = os.sysconf("SC_CLK_TCK")
    return Process(
        pid,
        int(fields[1]),
        tuple(words.split("\0")),
        int(fields[19]) / per_s,
        (int(fields[11]) + int(fields[12])) / per_s,
    )


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise Unmeasured(f"{path}: cannot be read ({error.strerror}); this measure needs Linux") from None
