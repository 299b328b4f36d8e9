"""The bases of the verdict's checks: each goes through a journal's ticks once and gives a result at the end.

Some test that chance explains a count, at a rate of false alarms that holds whenever counting stops. n draws that each
hit with probability p, of which x hit, are compared with draws of an unknown probability q, weighed over all q by a
Beta(1/2, 1/2) distribution:

    E = integral of q^x (1 - q)^(n - x) dBeta(q)  /  (p^x (1 - p)^(n - x))

As long as each draw's chance is p whatever came before, E is a martingale that begins at 1, so the probability that it
ever reaches 1 / a is at most a (Ville's inequality; Robbins, "Statistical methods related to the law of the iterated
logarithm", 1970). That holds for any rule of when to count and when to stop that does not look ahead: the number of
frames on a link may depend on earlier losses, which an exact binomial test rules out. The price is small: at 1e-9
about seven standard deviations are needed instead of six.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, cast

from patrol.faults.kinds import Fault, Join, Leave, Spoof
from patrol.journal.records import FORGED, Status
from patrol.pose import Command, command_of

if TYPE_CHECKING:
    from patrol.ground.fog import Fog
    from patrol.journal import Event, RobotTick, TickRecord
    from patrol.pose import Pose
    from patrol.prepare import Prepared
    from patrol.scenario import RobotSpec
    from worldsim.faults import Entry, Timeline
    from worldsim.run_record import RunRecord


NO_ROBOT = 0
"""The origin of frames that come from no robot's radio."""

TAGS_NOT_JUDGED = "; tags not judged: "
"""Comes before the reason, at the end of a detail."""

R = TypeVar("R", bound="JournalReading")


@dataclass(frozen=True, slots=True)
class CheckResult:
    """The result of one check."""

    name: str
    ok: bool
    detail: str  # what was found; where the run failed, the first problem
    judged: bool = True  # False: nothing to judge by, or too little; then `ok` is True and the detail says why
    warnings: tuple[str, ...] = ()  # what is wrong although the run can be believed, one line each


@dataclass(eq=False)
class JudgedRun:
    """A run as its verdict knows it, and the readings of its journal."""

    journal: RunRecord  # in one process still being written: events and end are read when they are needed
    prepared: Prepared
    timeline: Timeline
    exit_codes: Mapping[str, int | None]  # by process, None: never seen to end; empty for a run in one process
    verify_fog: bool = True  # recompute the fog, and what robots made of what they heard
    baseline_s: float | None = None  # mean MFoW of the same scenario without its faults; None if that was not run
    fog: Fog | None = None  # the world's own, after each tick, where it is not recomputed; None without a world
    has_robots: bool = True  # all ticks so far hold the scenario's robots (`RobotsThere`)
    readings: dict[type[JournalReading], JournalReading] = field(default_factory=dict)  # each after those that it needs

    def reading(self, kind: type[R]) -> R:
        """Return the reading of a class, which is made when it is first asked for."""
        if kind not in self.readings:
            self.readings[kind] = kind(self)
        return cast("R", self.readings[kind])

    def tick(self, record: TickRecord) -> None:
        """Give the next tick to all readings; once a tick lacks robots, to those alone that need none."""
        for reading in self.readings.values():
            if self.has_robots or reading.needs_no_robots:
                reading.tick(record)

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

    @property
    def notes(self) -> Mapping[str, Any]:
        """The notes of the journal's end, none without an end."""
        return {} if self.journal.end is None else self.journal.end.notes

    @cached_property
    def names(self) -> dict[int, str]:
        """The robots' names by number."""
        return {robot.number: robot.name for robot in self.journal.header.robots}

    @cached_property
    def specs(self) -> dict[int, RobotSpec]:
        """The robots as the scenario has them, by number."""
        return {spec.number: spec for spec in self.prepared.scenario.roster}

    @cached_property
    def starts(self) -> dict[int, Pose]:
        """The robots' poses at the start, by number."""
        return dict(zip(self.specs, self.prepared.starts, strict=True))

    def command(self, row: RobotTick) -> Command:
        """Return the command that a robot was to obey in a tick."""
        return command_of(self.specs[row.number].model, row.c0, row.c1)

    @cached_property
    def forgers(self) -> dict[str, int]:
        """The numbers of the robots that forge (`NO_ROBOT` for a stranger) by the ids of the spoofs."""
        return {entry.id: entry.sources[0] for entry in self.entries(Spoof)}

    @cached_property
    def absent_at_first(self) -> frozenset[int]:
        """The spare robots, and those that join before they leave."""
        first: dict[int, Fault] = {}
        for entry in sorted(self.entries(Join, Leave), key=lambda entry: entry.begin):
            for number in entry.who:
                first.setdefault(number, entry.fault)
        joining = {number for number, fault in first.items() if isinstance(fault, Join)}
        return self.prepared.scenario.spares | joining

    def lost_in(self, k: int) -> set[int]:
        """Return the robots that were lost in a tick, by the events before the next.

        For example, robots whose "lost" event has k = 8 were lost in tick 7.
        """
        lost = Status.LOST.name.lower()
        return {e.robot for e in self.journal.events if e.k == k + 1 and e.kind == lost and e.robot is not None}

    def entries(self, *kinds: type[Fault]) -> list[Entry]:
        """Return the faults of some kinds, by index."""
        return [entry for entry in self.timeline.entries if isinstance(entry.fault, kinds)]


class JournalReading(ABC):
    """A reader of a journal's ticks, in order, that can be asked about them."""

    needs_no_robots: ClassVar[bool] = False  # takes in ticks even once one did not hold the scenario's robots

    def __init__(self, run: JudgedRun) -> None:
        """Prepare to read a run. A reading that this one needs is asked for here, so it takes in each tick before."""
        self._run = run
        self._step = run.step
        self._specs = run.specs
        self._events_read = 0
        if not self.needs_no_robots:
            run.reading(RobotsThere)

    @abstractmethod
    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""

    def _events_before(self, k: int) -> Sequence[Event]:
        """Return the events before a tick that were not returned yet.

        For example, the first call with k = 3 gives all events up to tick 3, and one with k = 4 after it those of tick
        4 alone.
        """
        events, first = self._run.journal.events, self._events_read
        while self._events_read < len(events) and events[self._events_read].k <= k:
            self._events_read += 1
        return events[first : self._events_read]

    def _name(self, number: int) -> str:
        """Return the name of a robot, or of the sender of forged frames."""
        return "a forger" if number == FORGED else self._run.names.get(number, str(number))


class Check(JournalReading):
    """A check of the verdict. A subclass implements `_tick` and `_end`, and reports problems by `_fail`.

    It warns by adding to `_warnings`, and says in `_unknown` why it cannot judge.
    """

    name: ClassVar[str]
    kinds: ClassVar[tuple[type[Fault], ...]] = ()  # of faults that call for the check; empty: it needs none
    of_ether: ClassVar[bool] = False  # about frames that the world carried: makes no sense with direct radio
    reads_on: ClassVar[bool] = False  # takes in ticks after its first problem, because others need what it reads

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._entries = run.entries(*self.kinds)
        self._problem = ""
        self._unknown = ""  # why nothing can be judged
        self._warnings: list[str] = []
        self._looked = 0  # how much was judged so far, for the detail

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if a run calls for this check."""
        return (run.by_ether or not cls.of_ether) and (not cls.kinds or bool(run.entries(*cls.kinds)))

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick; nothing after the first problem, unless the check `reads_on`."""
        if self.reads_on or not self._problem:
            self._tick(record)

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in and the journal has ended."""
        detail = self._end()
        if self._unknown:
            return CheckResult(self.name, True, self._unknown, judged=False)
        return CheckResult(self.name, not self._problem, self._problem or detail, warnings=tuple(self._warnings))

    def _tick(self, record: TickRecord) -> None:
        """Look at a tick; nothing for a check that looks at the run's end only."""

    @abstractmethod
    def _end(self) -> str:
        """Look at the run's end, and return the detail of a result without a problem."""

    def _fail(self, problem: str) -> None:
        """Note a problem; the first is kept."""
        # Later problems often follow from the first.
        self._problem = self._problem or problem

    def _active(self, k: int) -> list[Entry]:
        """Return the faults of the check's `kinds` that are active in a tick, by index."""
        return [entry for entry in self._entries if active(entry, k)]

    def _way(self, link: tuple[int, int, int]) -> str:
        """Name the ends of a link."""
        return f"from {self._name(link[0])} to {self._name(link[1])}"


class RobotsThere(Check):
    """Every tick holds the scenario's robots, in roster order, each somewhere on the terrain.

    Checks that compute from poses get no more ticks once this one has failed.
    """

    name = "robots there"
    needs_no_robots = True

    def _tick(self, record: TickRecord) -> None:
        roster, terrain = self._run.prepared.scenario.roster, self._run.prepared.terrain
        if [row.number for row in record.robots] != [spec.number for spec in roster]:
            self._fail(f"tick {record.k} does not hold the scenario's robots")
        else:
            for spec, row in zip(roster, record.robots, strict=True):
                if not (terrain.contains(row.x, row.y) and math.isfinite(row.heading)):
                    where = f"({row.x}, {row.y}; {row.heading} rad)"
                    self._fail(f"{spec.name} is not on the terrain at tick {record.k}: {where}")
        self._run.has_robots = not self._problem

    def _end(self) -> str:
        return f"all {len(self._run.prepared.scenario.roster)} robots in every tick"


def active(entry: Entry, k: int) -> bool:
    """Return True if a lasting fault is active in tick k."""
    return entry.begin <= k and (entry.end is None or k < entry.end)


def on_link(entry: Entry, origin: int, to: int) -> bool:
    """Return True if a fault of links acts on the frames that one robot's radio sends to another."""
    return origin in entry.sources and to in entry.targets


def robots_hit(entries: Iterable[Entry], k: int) -> set[int]:
    """Return the robots on which some of these faults act in a tick."""
    return {number for entry in entries if active(entry, k) for number in entry.who}


FAMILY = 1e-9
"""The probability of any false alarm in all of a run's statistical checks together."""


def evidence(hits: int, draws: int, p: float) -> float:
    """Return ln E, with E as in the module's docstring; infinite where p excludes the hits.

    For example, 0 without draws, and infinite for a hit with p = 0.
    """
    # Also keeps the logarithms below finite.
    if (p <= 0.0 and hits) or (p >= 1.0 and hits < draws):
        return math.inf
    under = 0.0
    if hits:
        under += hits * math.log(p)
    if draws - hits:
        # Exact also where p is tiny.
        under += (draws - hits) * math.log1p(-p)
    return _log_beta(hits + 0.5, draws - hits + 0.5) - _log_beta(0.5, 0.5) - under


def enough(draws: int, p: float, alarm: float) -> bool:
    """Return True if there are enough draws that some number of hits would be unexplained.

    For example, at 1e-9 and p = 0.3, 100 draws are enough; at p = 0.5, 3 draws are not.
    """
    # No count is less likely than one of these two.
    return max(evidence(0, draws, p), evidence(draws, draws, p)) >= -math.log(alarm)


def unexplained(hits: int, draws: int, p: float, alarm: float) -> bool:
    """Return True if chance does not explain a number of hits; `alarm` bounds a false alarm's probability.

    For example, at 1e-9 and p = 0.3, chance explains 60 hits of 100 draws, but not 90.
    """
    return evidence(hits, draws, p) >= -math.log(alarm)


@dataclass(slots=True)
class Series:
    """Draws that each hit with probability `p`, and the words for how many hit and how many should have.

    For example, "f1: {hits} of {draws} frames were lost" and ", 50 % configured".
    """

    p: float
    words: str
    expected: str
    draws: int = 0
    hits: int = 0

    def add(self, hit: bool) -> None:
        """Count one draw."""
        self.draws += 1
        self.hits += hit

    def found(self) -> str:
        """Say how many draws have hit."""
        return self.words.format(hits=self.hits, draws=self.draws)

    def is_told(self, alarm: float) -> bool:
        """Return True if there are enough draws to judge by."""
        return enough(self.draws, self.p, alarm)

    def problem(self, alarm: float) -> str:
        """Say that chance does not explain the hits; empty where it does, or there are too few draws."""
        if self.is_told(alarm) and unexplained(self.hits, self.draws, self.p, alarm):
            return self.found() + self.expected
        return ""


def first_problem(series: Iterable[Series], alarm: float) -> str:
    """Return the first problem of some series, empty where chance explains all of them."""
    return next(filter(None, (entry.problem(alarm) for entry in series)), "")


def _log_beta(a: float, b: float) -> float:
    return math.lgamma(a) + math.lgamma(b) - math.lgamma(a + b)
