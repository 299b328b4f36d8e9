"""The base of the verdict's checks: each goes through a journal's ticks once and gives a result at the end."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, TypeVar

from patrol.journal.records import FORGED

if TYPE_CHECKING:
    from patrol.ground.fog import Fog
    from patrol.journal import TickRecord
    from patrol.prepare import Prepared
    from worldsim.faults import Timeline
    from worldsim.run_record import RunRecord


TAGS_NOT_JUDGED = "; tags not judged: "
"""Comes before the reason, at the end of a detail."""


@dataclass(frozen=True, slots=True)
class CheckResult:
    """The result of one check."""

    name: str
    ok: bool
    detail: str  # what was found; where the run failed, the first problem
    judged: bool = True  # False: nothing to judge by, or too little; then `ok` is True and the detail says why
    warnings: tuple[str, ...] = ()  # what is wrong although the run can be believed, one line each


@dataclass(frozen=True)
class JudgedRun:
    """A run as its verdict knows it."""

    journal: RunRecord  # may still be being written: events and end are read when they are needed
    prepared: Prepared
    timeline: Timeline
    exit_codes: Mapping[str, int | None]  # by process, None: never seen to end; empty for a run in one process
    verify_fog: bool = True  # recompute the fog, and what robots made of what they heard
    baseline_s: float | None = None  # mean MFoW of the same scenario without its faults; None if that was not run
    fog: Fog | None = None  # the world's own, after each tick, where it is not recomputed; None without a world

    @property
    def processes(self) -> bool:
        """True if the robots were processes."""
        return bool(self.exit_codes)

    @property
    def by_ether(self) -> bool:
        """True if the world carried the frames, so that their fates are known."""
        return self.prepared.scenario.radio.via == "ether"

    @property
    def step(self) -> float:
        """The length of a tick, s."""
        return self.prepared.scenario.step

    @cached_property
    def names(self) -> dict[int, str]:
        """The robots' names by number."""
        return {robot.number: robot.name for robot in self.journal.header.robots}

    @cached_property
    def senders(self) -> dict[int, str]:
        """The robots' names by number, and what to call the sender of forged frames."""
        return {**self.names, FORGED: "a forger"}


class JournalReading(ABC):
    """A reader of a journal's ticks, in order, that can be asked about them.

    The readings that it `needs` take in each tick before it does, and once one of them is not `usable` any more, this
    one gets no further ticks. `needed` are these readings.
    """

    needs: ClassVar[tuple[type[JournalReading], ...]] = ()

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        """Prepare to read a run."""
        self._run = run
        self.needed = tuple(readings[kind] for kind in self.needs)

    @property
    def usable(self) -> bool:
        """True if readings that need this one can go on."""
        return True

    @abstractmethod
    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""


R = TypeVar("R", bound=JournalReading)


class Readings:
    """The readings of one run, by their classes."""

    def __init__(self) -> None:
        self._made: dict[type[JournalReading], JournalReading] = {}

    def __getitem__(self, kind: type[R]) -> R:
        """Return the reading of that class."""
        found = self._made[kind]
        assert isinstance(found, kind)
        return found

    def add(self, kind: type[JournalReading], run: JudgedRun) -> None:
        """Make a reading, and before it those that it needs; none twice."""
        if kind not in self._made:
            for needed in kind.needs:
                self.add(needed, run)
            self._made[kind] = kind(run, self)

    def in_order(self) -> list[JournalReading]:
        """All readings, each after those that it needs."""
        return list(self._made.values())


class Check(JournalReading):
    """A check of the verdict. A subclass implements `_tick` and `_good`, and reports problems by `_fail`."""

    name: ClassVar[str]
    of_ether: ClassVar[bool] = False  # about frames that the world carried: makes no sense with direct radio
    reads_on: ClassVar[bool] = False  # takes in ticks after its first problem, because others need what it reads

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._problem = ""

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if a run calls for this check."""
        return run.by_ether or not cls.of_ether

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick; nothing after the first problem, unless the check `reads_on`."""
        if self.reads_on or not self._problem:
            self._tick(record)

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in and the journal has ended."""
        return CheckResult(self.name, not self._problem, self._problem or self._good())

    def _tick(self, record: TickRecord) -> None:
        """Look at a tick; nothing for a check that looks at the run's end only."""

    @abstractmethod
    def _good(self) -> str:
        """Return the detail of a result without a problem."""

    def _fail(self, problem: str) -> None:
        """Note a problem; the first is kept."""
        self._problem = self._problem or problem

    def _not_judged(self, why: str) -> CheckResult:
        return CheckResult(self.name, True, why, judged=False)
