"""The verdict: whether a run can be believed, judged from its prepared scenario, journal and exit codes alone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from patrol.process.exit_codes import UNKNOWN
from worldsim.faults import Timeline
from worldsim.verdict.common.check import Check, CheckResult, JudgedRun, Readings
from worldsim.verdict.common.robots_there import RobotsThere
from worldsim.verdict.frames.budget import WithinBudget
from worldsim.verdict.frames.direct_links import DirectLinks
from worldsim.verdict.frames.drops import DropsExplained, NothingCrossed
from worldsim.verdict.frames.forgeries import SpoofsAsAsked
from worldsim.verdict.frames.hearing import ForgedAsConfigured, Hearing
from worldsim.verdict.frames.path_loss import PathLossAsAsked
from worldsim.verdict.frames.reach import WithinReach
from worldsim.verdict.frames.recomputed import FatesAsRecomputed, WithinBandwidth
from worldsim.verdict.frames.sent import FramesAreTrue, LinksAddUp
from worldsim.verdict.frames.shares import DelaysAsAsked, LossesAsAsked
from worldsim.verdict.frames.timing import OnTime
from worldsim.verdict.robots.battery_checks import BatteriesLast
from worldsim.verdict.robots.body_checks import BodiesApart, MovesAreTrue
from worldsim.verdict.robots.closure_checks import ClosuresKept
from worldsim.verdict.robots.event_checks import EventsFollow
from worldsim.verdict.robots.motion_checks import MotionAsAsked
from worldsim.verdict.robots.sense_checks import SensesAsAsked
from worldsim.verdict.robots.status_checks import DownAreSilent, NobodyLost, PausedStandStill, StatusesFollow
from worldsim.verdict.robots.zone_checks import KeepOutsKept, OneWayZonesKept, SlowZonesKept
from worldsim.verdict.run.bumps import BumpsRare
from worldsim.verdict.run.exit_codes import ExitCodes
from worldsim.verdict.run.fault_times import FaultsOnTime
from worldsim.verdict.run.fog_check import FogIsTrue
from worldsim.verdict.run.journal_checks import Complete, TraceAgrees
from worldsim.verdict.run.open_ages import AgesOpen, OpenFacts
from worldsim.verdict.run.progress import ProgressCheck, RunProgress
from worldsim.verdict.run.recovery import Recovers
from worldsim.verdict.run.router_answers import RouterAnswers
from worldsim.verdict.run.zone_ages import ZoneAges, ZoneFacts
from worldsim.verdict.run.zone_times import ZoneTimesTold

if TYPE_CHECKING:
    from patrol.ground.fog import Fog
    from patrol.journal import TickRecord
    from patrol.prepare import Prepared
    from patrol.summary.model import VerdictFacts
    from worldsim.run_record import RunRecord

Outcome = Literal["valid", "invalid", "unknown"]

EXIT_CODES: Mapping[Outcome, int] = {"valid": 0, "invalid": 1, "unknown": UNKNOWN}
"""Exit codes of commands that judge a run."""

CHECKS: tuple[type[Check], ...] = (
    Complete,
    TraceAgrees,
    NobodyLost,
    ExitCodes,
    DownAreSilent,
    LinksAddUp,
    DirectLinks,
    RouterAnswers,
    RobotsThere,
    FaultsOnTime,
    PausedStandStill,
    StatusesFollow,
    EventsFollow,
    BodiesApart,
    MovesAreTrue,
    MotionAsAsked,
    BatteriesLast,
    KeepOutsKept,
    SlowZonesKept,
    OneWayZonesKept,
    ClosuresKept,
    ZoneTimesTold,
    FramesAreTrue,
    FatesAsRecomputed,
    DropsExplained,
    SpoofsAsAsked,
    NothingCrossed,
    WithinReach,
    PathLossAsAsked,
    WithinBandwidth,
    WithinBudget,
    LossesAsAsked,
    OnTime,
    DelaysAsAsked,
    SensesAsAsked,
    FogIsTrue,
    Hearing,
    ForgedAsConfigured,
    Recovers,
    BumpsRare,
    ProgressCheck,
)
"""All checks, in the order in which a verdict lists their results; each says which runs call for it."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """The results of a run's checks, and what follows from them."""

    outcome: Outcome  # "unknown" when the journal does not reach its end
    checks: tuple[CheckResult, ...]
    progress: RunProgress | None = None  # None if the fog was not looked at
    zones: ZoneFacts | None = None  # ages of the ground of each zone; None without zones or without a look at the fog
    # ages of ground while it was open to view; None without closures or without a look at the fog
    open_ages: OpenFacts | None = None

    @property
    def valid(self) -> bool:
        """True if the run can be believed."""
        return self.outcome == "valid"

    @property
    def exit_code(self) -> int:
        """0 valid, 1 invalid, 3 unknown."""
        return EXIT_CODES[self.outcome]

    @property
    def failed(self) -> tuple[CheckResult, ...]:
        """The results of the checks that failed."""
        return tuple(check for check in self.checks if not check.ok)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Faults of the patrol although the run can be believed, one line each."""
        return tuple(line for check in self.checks for line in check.warnings)


def stated_verdict(facts: VerdictFacts | None) -> Verdict:
    """Return the verdict that a summary states, without what the checks found besides.

    None stands for a run that has not been judged; its verdict is ``unknown``.
    """
    if facts is None or facts.outcome not in EXIT_CODES:
        return Verdict("unknown", ())
    checks = (
        CheckResult(check.name, check.ok, check.detail, check.judged, tuple(check.warnings)) for check in facts.checks
    )
    return Verdict(facts.outcome, tuple(checks))  # type: ignore[arg-type]  # a key of EXIT_CODES


class Judge:
    """A verdict in the making: give it every tick's record, then ask. It does not read the journal's ticks itself."""

    def __init__(
        self,
        journal: RunRecord,
        exit_codes: Mapping[str, int | None],
        prepared: Prepared,
        *,
        verify_fog: bool = True,
        baseline_s: float | None = None,
        fog: Fog | None = None,
    ) -> None:
        """Choose the checks that the run calls for; `journal` may still be being written.

        Unlike for `judge`, `prepared` has the faults that operators added. With `verify_fog` the fog is recomputed,
        which takes longer than all other checks together, and so is what robots made of what they heard. Without it the
        verdict lacks these checks. That is for a sweep, whose world has just computed the same numbers from the same
        poses with the same code in the same process. The true `fog` of that world lets progress be judged all the same.
        """
        self._journal = journal
        known = None if verify_fog else fog
        run = JudgedRun(journal, prepared, Timeline(prepared.scenario), exit_codes, verify_fog, baseline_s, known)
        readings = Readings()
        listed = [kind for kind in CHECKS if kind.applies(run)]
        for kind in listed:
            readings.add(kind, run)
        zoned = ZoneAges.applies(run) and (verify_fog or fog is not None)
        if zoned:
            readings.add(ZoneAges, run)
        self._zones = readings[ZoneAges] if zoned else None
        closing = AgesOpen.applies(run) and (verify_fog or fog is not None)
        if closing:
            readings.add(AgesOpen, run)
        self._open_ages = readings[AgesOpen] if closing else None
        self._checks = [readings[kind] for kind in listed]
        self._readings = readings.in_order()

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        for reading in self._readings:
            for other in reading.needed:
                if not other.usable:
                    break
            else:
                reading.tick(record)

    def verdict(self) -> Verdict:
        """Return the verdict, once all ticks are in and the journal has ended."""
        checks = tuple(check.result() for check in self._checks)
        zones = None if self._zones is None else self._zones.facts()
        open_ages = None if self._open_ages is None else self._open_ages.facts()
        progress = [check.facts() for check in self._checks if isinstance(check, ProgressCheck)]
        return Verdict(_outcome(self._journal, checks), checks, progress[0] if progress else None, zones, open_ages)


def judge(
    journal: RunRecord | None,
    exit_codes: Mapping[str, int | None],
    prepared: Prepared,
    *,
    baseline_s: float | None = None,
) -> Verdict:
    """Judge a run; without a journal (None) the verdict is ``unknown``.

    Exit codes are by name of process (`worldsim.faults.process_name`): None for a process that was never seen
    to end, and no codes at all for a run in one process. Poses and fog are recomputed from `prepared`; what operators
    added is read from the journal. `baseline_s` is the mean MFoW of the same scenario without its faults, for the check
    of recovery; None if unknown.
    """
    if journal is None:
        return Verdict("unknown", (CheckResult("journal", False, "there is no journal"),))
    prepared = prepared.as_operated(journal.events)
    judging = Judge(journal, exit_codes, prepared, baseline_s=baseline_s)
    for record in journal.ticks:
        judging.tick(record)
    return judging.verdict()


def _outcome(journal: RunRecord, checks: Iterable[CheckResult]) -> Outcome:
    if journal.end is None or journal.truncated:
        return "unknown"
    return "valid" if all(check.ok for check in checks) else "invalid"
