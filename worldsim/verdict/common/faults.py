"""Readings of a fault's entry without the code that carries faults out, and the base of checks of such faults."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

from patrol.faults.kinds import Fault, Join, Leave, Spoof
from worldsim.verdict.common.check import Check
from worldsim.verdict.common.robots_there import RobotsThere

if TYPE_CHECKING:
    from patrol.journal import TickRecord
    from worldsim.faults import Entry, Timeline
    from worldsim.verdict.common.check import JudgedRun, Readings

NO_ROBOT = 0
"""The origin of frames that come from no robot's radio."""


def active(entry: Entry, k: int) -> bool:
    """Return True if a lasting fault is active in tick k."""
    return entry.begin <= k and (entry.end is None or k < entry.end)


def on_link(entry: Entry, origin: int, to: int) -> bool:
    """Return True if a fault of links acts on what one robot's radio sends to another."""
    return origin in entry.sources and to in entry.targets


def absent_at_first(timeline: Timeline) -> frozenset[int]:
    """Return the robots that join before they leave."""
    first: dict[int, Fault] = {}
    for entry in sorted(timeline.entries, key=lambda entry: entry.begin):
        for number in entry.who if isinstance(entry.fault, Join | Leave) else ():
            first.setdefault(number, entry.fault)
    return frozenset(number for number, fault in first.items() if isinstance(fault, Join))


def forgers_of(timeline: Timeline) -> dict[str, int]:
    """Return the numbers of the robots that forge (`NO_ROBOT` for a stranger) by the ids of the spoofs."""
    return {entry.id: entry.sources[0] for entry in timeline.entries if isinstance(entry.fault, Spoof)}


class FrameFaultCheck(Check):
    """A check of what faults of some kinds do to frames that the world carries.

    A subclass implements `_active_tick`, or `_tick` if it also looks at ticks in which none of its faults is active.
    """

    needs = (RobotsThere,)
    of_ether = True
    kinds: ClassVar[tuple[type[Fault], ...]]  # faults that call for the check, and that it looks at

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._names = run.senders
        self._entries = [entry for entry in run.timeline.entries if isinstance(entry.fault, self.kinds)]
        self._forgers = forgers_of(run.timeline)

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the world carried frames and a fault of these kinds acts on them."""
        return super().applies(run) and any(isinstance(entry.fault, cls.kinds) for entry in run.timeline.entries)

    def _tick(self, record: TickRecord) -> None:
        entries = [entry for entry in self._entries if active(entry, record.k)]
        if entries:
            self._active_tick(record, entries)

    def _active_tick(self, record: TickRecord, entries: Sequence[Entry]) -> None:
        """Look at a tick in which some of the faults are active."""

    def _frame(self, link: tuple[int, int, int], k: int) -> str:
        """Name a frame of tick k on a link."""
        source, to, _ = link
        return f"a frame from {self._names.get(source, source)} to {self._names.get(to, to)} of tick {k}"
