"""The verdict: whether a run can be believed, judged from its prepared scenario, journal and exit codes alone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal

from runtime.process.failures import UNKNOWN
from worldsim.checks.arrivals import DelaysAsAsked, LossesAsAsked, OnTime
from worldsim.checks.bodies import BatteriesLast, BodiesApart, BumpsRare, MovesAreTrue
from worldsim.checks.check import Check, CheckResult, JudgedRun, RobotsThere
from worldsim.checks.closures import ClosuresKept
from worldsim.checks.disturbed import MotionAsAsked, SensesAsAsked
from worldsim.checks.fates import DropsExplained, NothingCrossed, WithinBandwidth
from worldsim.checks.ground import FogIsTrue
from worldsim.checks.heard import FatesAsRecomputed, ForgedAsConfigured, Hearing, LinksAddUp
from worldsim.checks.journal import (
    Complete,
    DirectLinks,
    ExitCodes,
    FaultsOnTime,
    PausedStandStill,
    RouterAnswers,
    TraceAgrees,
)
from worldsim.checks.progress import ProgressCheck, Recovers, RunProgress
from worldsim.checks.reach import PathLossAsAsked, WithinReach
from worldsim.checks.sent import FramesAreTrue, SpoofsAsAsked, WithinBudget
from worldsim.checks.statuses import DownAreSilent, EventsFollow, NobodyLost, StatusesFollow
from worldsim.checks.zones import KeepOutsKept, SlowZonesKept, ZoneTimesTold
from worldsim.faults import Timeline
from worldsim.verdict.ages import AgesOpen, OpenFacts, ZoneAges, ZoneFacts
from worldsim.verdict.figures import Figures, Found, compare

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
    recomputed: Found = field(default_factory=dict, compare=False)  # figures that the summary must have

    def with_figures_of(self, summary: Mapping[str, Any]) -> Verdict:
        """Return the verdict with the check of a summary's figures besides."""
        check = compare(self.recomputed, summary)
        outcome: Outcome = self.outcome if check.ok or self.outcome == "unknown" else "invalid"
        return replace(self, outcome=outcome, checks=(*self.checks, check))

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
    def figures(self) -> dict[str, Any]:
        """Entries of the summary that only a look at the fog can give."""
        return {name: value for facts in (self.zones, self.open_ages) if facts for name, value in facts.figures.items()}

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
        stated_fog = None if verify_fog else fog
        run = JudgedRun(journal, prepared, Timeline(prepared.scenario), exit_codes, verify_fog, baseline_s, stated_fog)
        self._run = run
        self._checks = [run.reading(kind) for kind in CHECKS if kind.applies(run)]
        has_fog = verify_fog or fog is not None
        self._zones = run.reading(ZoneAges) if has_fog and ZoneAges.applies(run) else None
        self._open_ages = run.reading(AgesOpen) if has_fog and AgesOpen.applies(run) else None
        self._figures = run.reading(Figures)

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        self._run.tick(record)

    def verdict(self) -> Verdict:
        """Return the verdict without the check of the summary, once all ticks are in and the journal has ended."""
        checks = tuple(check.result() for check in self._checks)
        zones = None if self._zones is None else self._zones.facts()
        open_ages = None if self._open_ages is None else self._open_ages.facts()
        progress = next((check.facts() for check in self._checks if isinstance(check, ProgressCheck)), None)
        figures = self._figures.figures()
        return Verdict(_outcome(self._run.journal, checks), checks, progress, zones, open_ages, figures)


def judge(
    journal: RunRecord, exit_codes: Mapping[str, int | None], prepared: Prepared, *, baseline_s: float | None = None
) -> Verdict:
    """Judge a run.

    Exit codes are by name of process (`worldsim.faults.process_name`): None for a process that was never seen
    to end, and no codes at all for a run in one process. Poses and fog are recomputed from `prepared`; what operators
    added is read from the journal. `baseline_s` is the mean MFoW of the same scenario without its faults, for the check
    of recovery; None if unknown.
    """
    prepared = prepared.as_operated(journal.events)
    judging = Judge(journal, exit_codes, prepared, baseline_s=baseline_s)
    for record in journal.ticks:
        judging.tick(record)
    return judging.verdict()


def _outcome(journal: RunRecord, checks: Iterable[CheckResult]) -> Outcome:
    # Before the checks: a check may fail only because the end is missing.
    if journal.end is None or journal.truncated:
        return "unknown"
    return "valid" if all(check.ok for check in checks) else "invalid"
