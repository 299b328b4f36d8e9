"""A whole fleet in one process: the same minds, the same world and the same ticks as over Zenoh, and the same trace."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from agent.answers import policy_failure
from agent.build import Shared, build_mind
from agent.mind import MakeMind, Mind
from agent.policies.found import PolicyKind, policy_of
from agent.ports import PolicyFailed
from fogwatch.workers import WithoutProcesses, Workers
from patrol.errors import BadInput
from patrol.exchange import FIRST_INCARNATION, Reply, Sensed
from patrol.journal import Event, JournalWriter, Status, TickRecord, read_journal
from patrol.measures.zoned import with_rounds
from patrol.own_sensor import allow_sensor
from patrol.prepare import Prepared, prepare, sensor_footprint
from patrol.radio.message import as_received
from runtime.process.deadline import Late, deadline
from worldsim.fleet.loop import run_ticks
from worldsim.fleet.process_control import NotStarted
from worldsim.output.record import Recorder, header_of
from worldsim.output.summary import Totals, summarise
from worldsim.run_record import COMPLETED, INTERRUPTED, MemoryJournal, RunRecord, Writer
from worldsim.verdict.judge import Judge, Verdict, judge
from worldsim.world import World

if TYPE_CHECKING:
    from agent.belief.believed import Beliefs
    from agent.chance import Chance
    from agent.view import View
    from fogwatch.workers import PolicyFailure
    from patrol.ground.footprint import Footprint
    from patrol.scenario import Scenario
    from patrol.summary.model import Summary

__all__ = ["InProcessFleet", "Outcome", "run_in_process"]


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of a run: its records, their summary, and the verdict on it."""

    journal: RunRecord
    summary: Summary
    verdict: Verdict


class InProcessFleet(WithoutProcesses):
    """The minds of a fleet, called directly.

    It implements `worldsim.fleet.loop.Fleet` and `worldsim.fleet.process_control.ProcessControl`.

    A mind whose policy fails is lost, as its process would be; the others go on.

    `chance` is what all minds draw from, those made later too; None for minds that were made otherwise.
    """

    def __init__(
        self,
        minds: Mapping[int, Mind],
        make: MakeMind | None = None,
        beliefs: Beliefs | None = None,
        failure: PolicyFailure = lambda _number, _reason, _error: None,
        chance: Chance | None = None,
    ) -> None:
        """Take in minds by robot number; `make` makes a new one by robot number and incarnation.

        `beliefs` is what the minds believe, where they share it. `failure` is told of each policy that fails.
        """
        self.chance = chance
        self._beliefs = beliefs
        self._failure = failure
        self._minds = dict(minds)
        self._failed: dict[int, str] = {}
        self._unmade: dict[int, str] = {}
        self._make = make
        self._sensed: Mapping[int, Sensed] = {}
        self._views: Mapping[int, View] = {}

    @property
    def minds(self) -> Mapping[int, Mind]:
        """The minds that there are, by robot number."""
        return self._minds

    def phase_a(self, k: int, reports: Mapping[int, Sensed]) -> Mapping[int, Sequence[bytes]]:
        """Return the frames that every mind sends."""
        del k
        self._sensed = {number: self._minds[number].locate(sensed) for number, sensed in reports.items()}
        return {number: self._minds[number].frames(sensed) for number, sensed in self._sensed.items()}

    def look(self, k: int, heard: Mapping[int, list[bytes]]) -> Mapping[int, View]:
        """Let the minds hear before `phase_b` of the same tick, and return what they would decide by.

        `heard` is as for `phase_b`; the views are by robot number, of the minds that decide in this tick.
        """
        self._hear_beliefs(k, heard)
        if self._beliefs is None:
            for number, frames in heard.items():
                self._minds[number].hear(self._sensed[number], frames)
        self._views = {number: self._minds[number].look(self._sensed[number]) for number in heard}
        return self._views

    def phase_b(self, k: int, heard: Mapping[int, list[bytes]]) -> Mapping[int, Reply]:
        """Return every mind's command."""
        if not self._views:
            self._hear_beliefs(k, heard)
        replies = {number: reply for number in heard if (reply := self._step_robot(k, number, heard)) is not None}
        self._views = {}
        return replies

    def lost(self) -> Sequence[tuple[int, Status, str]]:
        """Return the robots whose policy has failed in this tick; any other error of a mind fails the run."""
        lost = [(number, Status.LOST, reason) for number, reason in sorted(self._failed.items())]
        self._failed.clear()
        for number, _, _ in lost:
            self.kill(number)
        return lost

    def leave(self, number: int) -> None:
        """Drop a mind; it has nothing to put in order."""
        self.kill(number)

    def kill(self, number: int) -> None:
        """Drop a mind, with all that it knew."""
        self._minds.pop(number, None)
        if self._beliefs is not None:
            self._beliefs.leave(number)

    def start(self, number: int, incarnation: int) -> None:
        """Make a new mind."""
        if self._make is None:
            raise ValueError("this fleet cannot make minds")
        try:
            self._minds[number] = self._make(number, incarnation)
        except PolicyFailed as failed:
            self._unmade[number] = str(failed)
            self._failure(number, str(failed), failed.__cause__)

    def arrived(self, number: int) -> bool:
        """Return True at once; a mind whose policy cannot be made raises NotStarted."""
        if (reason := self._unmade.pop(number, None)) is not None:
            raise NotStarted(reason)
        return number in self._minds

    def finish(self, k: int) -> None:
        """Do nothing: the minds go with this object."""
        del k

    def _hear_beliefs(self, k: int, heard: Mapping[int, list[bytes]]) -> None:
        """Let the minds that share what they believe hear."""
        if self._beliefs is not None:
            poses = {number: as_received(self._sensed[number].pose) for number in heard}
            self._beliefs.hear(k, poses, heard)

    def _step_robot(self, k: int, number: int, heard: Mapping[int, list[bytes]]) -> Reply | None:
        mind, sensed, view = self._minds[number], self._sensed[number], self._views.get(number)
        begun = time.perf_counter()
        try:
            with deadline(mind.facts.limit_s):
                if self._beliefs is None and view is None:
                    decision = mind.step(sensed, heard[number])
                else:
                    decision = mind.decide(sensed, view)
        except (PolicyFailed, Late) as failed:
            self._failed[number] = reason = policy_failure(k, failed)
            self._failure(number, reason, failed.__cause__)
            return None
        spent_ms = (time.perf_counter() - begun) * 1000.0
        return Reply(decision.command, str(decision.state), decision.refined, spent_ms, decision.rejected)


def make_minds(prepared: Prepared) -> dict[int, Mind]:
    """Return the first minds of a scenario's whole roster, by robot number."""
    shared = Shared(prepared)
    return {number: build_mind(shared, number) for number in prepared.scenario.numbers}


def check_in_process(scenario: Scenario) -> None:
    """Refuse a scenario with a direct radio, which one process cannot run, and allow its sensor."""
    if scenario.radio.via != "ether":
        raise BadInput("radio.via = direct: in one process there is no network to hear each other by; run as processes")
    allow_sensor(scenario.sensor)


def fleet_of(
    world: World,
    footprint: Footprint,
    *,
    kind: PolicyKind | None = None,
    share: bool = True,
    failure: PolicyFailure = lambda _number, _reason, _error: None,
    numbers: Sequence[int] | None = None,
) -> InProcessFleet:
    """Make the fleet of a world before its first tick.

    `footprint` is the world's sensor. `kind` makes the robots' policies in place of the scenario's. `numbers` are those
    of the robots whose minds it makes, now or later: the whole roster unless given. The other options are as for
    `run_in_process`.
    """
    prepared = world.prepared
    kind = kind or policy_of(prepared.scenario)
    if numbers is None:
        numbers = prepared.scenario.numbers
    shared = Shared(prepared, footprint, believers=numbers if share else (), kind=kind)
    make = partial(build_mind, shared)
    minds: dict[int, Mind] = {}
    for number in sorted(set(numbers) & set(world.living)):
        try:
            minds[number] = make(number, FIRST_INCARNATION)
        except PolicyFailed as failed:
            failure(number, str(failed), failed.__cause__)
            raise BadInput(str(failed)) from failed
    return InProcessFleet(minds, make, shared.beliefs, failure, shared.chance)


def run_in_process(
    scenario: Scenario | Prepared,
    *,
    journal: Path | None = None,
    started: str | None = None,
    progress: Callable[[TickRecord], None] | None = None,
    events: Callable[[Event], None] | None = None,
    stop: Callable[[], bool] = lambda: False,
    workers: int = 1,
    keep: bool = True,
    verify_fog: bool = True,
    look: Callable[[World, Mapping[int, Mind]], None] | None = None,
    watch: Callable[[World], Callable[[TickRecord], None]] | None = None,
    baseline_s: float | None = None,
    share: bool = True,
    failure: PolicyFailure = lambda _number, _reason, _error: None,
) -> Outcome:
    """Run a scenario to its end, or until `stop`, asked between ticks, says so.

    Without `journal` the records stay in memory. Without `keep` as well, only what they add up to stays, so that the
    memory needed does not grow with the run; `verify_fog` then decides if the verdict recomputes the fog
    (`worldsim.verdict.judge.Judge`). It always does where there are records to read again.

    `progress` takes each tick's record, and `events` each event, after it is recorded. `watch` makes, from the world
    before its first tick, what takes each tick's record after `progress`. `look` is called after each tick with the
    world and the minds by robot number, to compare what is with what they believe; it must change nothing.

    With several `workers` the minds are in as many processes, and `look` gets none of them. With `share`, minds whose
    beliefs are equal share them, which changes no trace. `baseline_s` is what `fault_free_mfow` gives, for the verdict
    to judge recovery by. `started` is the wall time for the journal's header, ISO 8601. `failure` is told of each
    policy that fails, so that its traceback can be kept. Any other error that a mind raises ends the run and is passed
    on.
    """
    prepared = scenario if isinstance(scenario, Prepared) else prepare(scenario)
    check_in_process(prepared.scenario)
    kind = policy_of(prepared.scenario)
    prepared = with_rounds(prepared, kind.follows_rounds)
    world = World(prepared, footprint=(footprint := sensor_footprint(prepared.scenario, prepared.terrain)))
    fleet: InProcessFleet | Workers
    minds: Mapping[int, Mind] = {}
    if workers > 1:

        def make_part(numbers: Sequence[int], failure: PolicyFailure) -> InProcessFleet:
            return fleet_of(world, footprint, kind=kind, share=share, failure=failure, numbers=numbers)

        fleet = Workers(workers, prepared.scenario.numbers, make_part, failure)
    else:
        fleet = fleet_of(world, footprint, kind=kind, share=share, failure=failure)
        minds = fleet.minds
    header = header_of(world, started)
    watchers: list[Callable[[TickRecord], None]] = [] if progress is None else [progress]
    if watch is not None:
        watchers.append(watch(world))
    if look is not None:
        watchers.append(lambda _: look(world, minds))
    if journal is None and not keep:
        memory = MemoryJournal(header, keep)
        judging = Judge(memory, {}, prepared, verify_fog=verify_fog, baseline_s=baseline_s, fog=world.truth.fog)
        totals = Totals(header)
        _run_ticks(world, fleet, memory, (judging.tick, totals.tick, *watchers), events, stop)
        return Outcome(memory, *totals.summary(memory, judging.verdict(), prepared))
    record: RunRecord
    if journal is None:
        record = memory = MemoryJournal(header)
        _run_ticks(world, fleet, memory, watchers, events, stop)
    else:
        with JournalWriter(journal, header) as writer:
            _run_ticks(world, fleet, writer, watchers, events, stop)
        record = read_journal(journal)
    return Outcome(record, *summarise(record, judge(record, {}, prepared, baseline_s=baseline_s), prepared))


def fault_free_mfow(prepared: Prepared, stop: Callable[[], bool] = lambda: False) -> float | None:
    """Return the mean MFoW of a scenario without its faults, s; None when `stop` has ended the run."""
    calm = replace(prepared, scenario=prepared.scenario.model_copy(update={"faults": ()}))
    outcome = run_in_process(calm, keep=False, verify_fog=False, stop=stop)
    completed = outcome.journal.end is not None and outcome.journal.end.reason == COMPLETED
    return outcome.summary.mfow_mean_s if completed else None


def _run_ticks(
    world: World,
    fleet: InProcessFleet | Workers,
    writer: Writer,
    watchers: Sequence[Callable[[TickRecord], None]],
    events: Callable[[Event], None] | None,
    stop: Callable[[], bool],
) -> None:
    recorder = Recorder(writer, world.scenario.spares)

    def on_tick(record: TickRecord) -> None:
        recorder.tick(record)
        for watcher in watchers:
            watcher(record)

    def on_event(event: Event) -> None:
        recorder.event(event)
        if events is not None:
            events(event)

    began = time.perf_counter()
    try:
        reason = run_ticks(world, fleet, on_tick, on_event, stop, fleet)
    except BaseException as error:
        if not isinstance(error, OSError):  # a full disk; the run cannot be judged by what it had room for
            interrupted = isinstance(error, KeyboardInterrupt)
            with suppress(OSError):
                recorder.end(INTERRUPTED if interrupted else f"failed: {type(error).__name__}: {error}")
        raise
    recorder.end(reason, {"wall_s": time.perf_counter() - began})
