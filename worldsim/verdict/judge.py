"""The verdict: whether a run can be believed, judged from its prepared scenario, journal and exit codes alone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from patrol.scenario.controls import prepared_as_operated
from patrol.scenario.faults.kinds import PROCESS_KINDS, SENSE_KINDS, Pause
from worldsim.timeline import Timeline
from worldsim.verdict.checks import (
    Check,
    Complete,
    FogIsTrue,
    NobodyLost,
    RobotsThere,
    Tally,
    TraceAgrees,
)
from worldsim.verdict.frames.direct_links import DirectLinks
from worldsim.verdict.frames.drops import DropsExplained, NothingCrossed
from worldsim.verdict.frames.forgeries import SpoofsAsAsked
from worldsim.verdict.frames.hearing import ForgedAsConfigured, Hearing
from worldsim.verdict.frames.reach import WithinReach
from worldsim.verdict.frames.recomputed import Replay, WithinBandwidth
from worldsim.verdict.frames.sent import FramesAreTrue, LinksAddUp
from worldsim.verdict.frames.shares import DelaysAsAsked, LossesAsAsked
from worldsim.verdict.frames.timing import FaultsOnTime, OnTime
from worldsim.verdict.robots.body_checks import BodiesApart, MovesAreTrue
from worldsim.verdict.robots.recovery import Recovers
from worldsim.verdict.robots.sense_checks import SensesAsAsked
from worldsim.verdict.robots.status_checks import DownAreSilent, ExitCodes, PausedStandStill, StatusesFollow

if TYPE_CHECKING:
    from patrol.journal import TickRecord
    from patrol.prepare import Prepared
    from worldsim.run_record import RunRecord

Outcome = Literal["valid", "invalid", "unknown"]

EXIT_CODES: Mapping[Outcome, int] = {"valid": 0, "invalid": 1, "unknown": 3}
"""What a command that judged a run ends with."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """What became of a run's checks; unknown when the journal does not reach its end, so that nobody can tell."""

    outcome: Outcome
    checks: tuple[Check, ...]

    @property
    def valid(self) -> bool:
        """Whether the run can be believed."""
        return self.outcome == "valid"

    @property
    def exit_code(self) -> int:
        """0 valid, 1 invalid, 3 unknown."""
        return EXIT_CODES[self.outcome]

    @property
    def failed(self) -> tuple[Check, ...]:
        """The checks that failed."""
        return tuple(check for check in self.checks if not check.ok)


class Judge:
    """A verdict in the making: give it every tick's record, then ask. The journal's ticks are not looked at."""

    def __init__(
        self,
        journal: RunRecord,
        exit_codes: Mapping[str, int | None],
        prepared: Prepared,
        *,
        verify_fog: bool = True,
        baseline_s: float | None = None,
    ) -> None:
        """As for `judge`; the journal may still be being written.

        verify_fog: whether to recompute the fog, which takes longer than all other checks together, and what robots
        made of what they heard. Without it the verdict has no checks of these names: for a sweep, whose world has just
        computed the same numbers from the same poses with the same code in the same process, so that nothing could
        have come between.
        """
        self._journal = journal
        self._there = RobotsThere(prepared)
        timeline = Timeline(prepared.scenario)
        replay = Replay(journal, prepared, timeline)
        carried = prepared.scenario.radio.via == "ether"
        self._always: list[Tally] = [
            Complete(journal),
            TraceAgrees(journal, prepared.scenario.spares),
            NobodyLost(journal),
            ExitCodes(journal, exit_codes, timeline),
            DownAreSilent(journal),
            LinksAddUp(journal, replay) if carried else DirectLinks(journal),
            self._there,
        ]
        self._of_poses: list[Tally] = [
            StatusesFollow(prepared, timeline),
            BodiesApart(journal, prepared, timeline),
            MovesAreTrue(prepared, timeline),
            FramesAreTrue(journal, prepared),
            *((replay, *_radio_checks(journal, prepared, timeline)) if carried else ()),
        ]
        if timeline.entries:
            self._always.append(FaultsOnTime(timeline, prepared.scenario.step))
        if any(isinstance(entry.fault, Pause) for entry in timeline.entries):
            self._always.append(PausedStandStill(journal, processes=bool(exit_codes)))
        if any(entry.fault.kind in SENSE_KINDS for entry in timeline.entries):
            self._of_poses.append(SensesAsAsked(journal, prepared, timeline))
        if verify_fog:
            self._of_poses.append(FogIsTrue(prepared))
        keyed = prepared.scenario.radio.key is not None
        befalls_frames = any(entry.fault.kind not in PROCESS_KINDS for entry in timeline.entries)
        if verify_fog and carried and (befalls_frames or keyed):
            hearing = Hearing(journal, prepared, replay, processes=bool(exit_codes))
            forged = ForgedAsConfigured(journal, prepared, timeline, hearing)
            self._of_poses += [hearing, forged] if forged.called_for else [hearing]
        if prepared.scenario.faults:
            self._of_poses.append(Recovers(journal, prepared, baseline_s))

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        for tally in self._always:
            tally.tick(record)
        for tally in self._of_poses if self._there.ok else ():
            tally.tick(record)

    def verdict(self) -> Verdict:
        """The verdict, once all ticks are in and the journal has ended."""
        checks = tuple(tally.check() for tally in (*self._always, *self._of_poses))
        return Verdict(_outcome(self._journal, checks), checks)


def judge(
    journal: RunRecord | None,
    exit_codes: Mapping[str, int | None],
    prepared: Prepared,
    *,
    baseline_s: float | None = None,
) -> Verdict:
    """Judge a run.

    journal: its records, or None when there is no journal. exit_codes: of the processes by name, robots by theirs;
    None for one that was never seen to end; empty for a run in one process. prepared: the run's scenario, starts and
    terrain, against which its poses and its fog are computed anew; what operators added, the journal tells.
    baseline_s: mean MFoW (s) of the same scenario without its faults, for the check of recovery; None when nobody has
    run that.
    """
    if journal is None:
        return Verdict("unknown", (Check("journal", False, "there is no journal"),))
    prepared = prepared_as_operated(prepared, journal.events)
    judging = Judge(journal, exit_codes, prepared, baseline_s=baseline_s)
    for record in journal.ticks:
        judging.tick(record)
    return judging.verdict()


def _radio_checks(journal: RunRecord, prepared: Prepared, timeline: Timeline) -> list[Tally]:
    """The checks besides the replay that a radio, and a scenario's faults of it, call for."""
    kinds = {entry.fault.kind for entry in timeline.entries}
    checks: list[Tally] = [DropsExplained(journal, timeline)]
    if "spoof" in kinds:
        checks.append(SpoofsAsAsked(prepared, timeline))
    if kinds & {"silence", "partition"}:
        checks.append(NothingCrossed(journal, timeline))
    if "range" in kinds:
        checks.append(WithinReach(journal, prepared.terrain, timeline))
    if "bandwidth" in kinds:
        checks.append(WithinBandwidth(journal, timeline))
    if "loss" in kinds:
        checks.append(LossesAsAsked(timeline))
    if kinds - {*PROCESS_KINDS, *SENSE_KINDS}:
        checks.append(OnTime(journal, timeline))
    if kinds & {"delay", "duplicate", "reorder"}:
        checks.append(DelaysAsAsked(timeline, prepared.scenario.step))
    return checks


def _outcome(journal: RunRecord, checks: Iterable[Check]) -> Outcome:
    if journal.end is None or journal.truncated:
        return "unknown"
    return "valid" if all(check.ok for check in checks) else "invalid"
