"""The verdict's check of the ticks in which faults begin and end, by what docs/faults.md says."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from patrol.faults.kinds import Lasting
from patrol.faults.targets import WORDS
from worldsim.verdict.common.check import Check

if TYPE_CHECKING:
    from worldsim.faults import Entry
    from worldsim.verdict.common.check import JudgedRun, Readings

_ROUNDING = 1e-9
"""Times that are this near to a tick, or to half of one, count as it, in ticks."""


class FaultsOnTime(Check):
    """Each fault begins and ends in the ticks of its `at` and `for`, and acts on the robots that it names.

    World and verdict take these from the same timeline, so nothing that happens in a run could reveal an error. Robots
    that are drawn are not drawn again.
    """

    name = "fault times"

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        wrong = [e for e in run.timeline.entries if not (_begins(e, run.step) and _ends(e, run.step))]
        self._problem = "; ".join(
            f"{entry.id} is scheduled from tick {entry.begin} "
            + ("to the end of the run" if entry.end is None else f"to before tick {entry.end}")
            + ", which is not what its `at` and `for` say"
            for entry in wrong
        )
        numbers = {name: number for number, name in run.names.items()}
        for entry in run.timeline.entries:
            if any(sorted(robots) != sorted(numbers[name] for name in names) for names, robots in _named(entry)):
                self._fail(f"{entry.id} acts on other robots than it names")

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the scenario has faults."""
        return bool(run.timeline.entries)

    def _good(self) -> str:
        return f"{len(self._run.timeline.entries)} faults scheduled by their `at` and `for`"


def _begins(entry: Entry, step: float) -> bool:
    """Return True if a fault begins in the first tick that is not before its `at`."""
    at = entry.fault.at / step - _ROUNDING
    return entry.begin >= at and (entry.begin == 0 or entry.begin - 1 < at)


def _named(entry: Entry) -> Iterator[tuple[Sequence[str], Sequence[int]]]:
    """Yield the robots that a fault names, not those that it asks for by number, and those that it acts on."""
    fields = {"who": entry.who, "victims": entry.who, "sources": entry.sources, "targets": entry.targets}
    for field, robots in fields.items():
        who = getattr(entry.fault, field, None)
        if isinstance(who, tuple):
            yield who, robots
        elif isinstance(who, str) and who not in WORDS:
            yield (who,), robots


def _ends(entry: Entry, step: float) -> bool:
    """Return True if a fault goes on for its `for`, rounded to ticks, half a tick up, and at least one tick."""
    fault = entry.fault
    if not isinstance(fault, Lasting):
        return entry.end == entry.begin
    if entry.end is None or fault.lasts is None:
        return entry.end is None and fault.lasts is None
    ticks = entry.end - entry.begin
    more = fault.lasts / step + _ROUNDING - ticks
    return more < 0.5 and (ticks == 1 or (ticks > 1 and more >= -0.5))
