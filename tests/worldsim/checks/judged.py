"""Runs of a lab under faults, altered afterwards, and their verdicts.

Where a test breaks the radio itself, the replay is broken in the same way and finds nothing: other checks have to.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from patrol.journal import trace_hash
from patrol.journal.records import sent_at
from patrol.prepare import Prepared
from patrol.summary.model import Summary
from worldsim.checks.check import Check, CheckResult, JudgedRun
from worldsim.faults import Timeline
from worldsim.output.summary import summarise
from worldsim.radio.fates import Fates, Sent
from worldsim.radio.rules import RadioRules, cause
from worldsim.run_record import MemoryJournal
from worldsim.verdict.judge import judge
from worldsim.world import World

Result = tuple[World, MemoryJournal]
Run = Callable[..., Result]
"""The fixture `run`: it runs a patrol under faults."""
Exits = Mapping[str, int | None]
C = TypeVar("C", bound=Check)


def checks(result: Result, exits: Exits | None = None) -> dict[str, CheckResult]:
    """The results of a verdict's checks, by name."""
    world, journal = result
    return {check.name: check for check in judge(journal, dict(exits or {}), world.prepared).checks}


def failures(result: Result, exits: Exits | None = None) -> dict[str, str]:
    """The details of the checks that failed, by name."""
    return {name: check.detail for name, check in checks(result, exits).items() if not check.ok}


def summary_of(result: Result) -> Summary:
    """The summary of a run."""
    return summarise(result[1], judge(result[1], {}, result[0].prepared), result[0].prepared)[0]


def change(journal: MemoryJournal, k: int, **fields: Any) -> None:
    """Alter one tick's record, and make the trace hash agree with it."""
    journal.records[k] = replace(journal.records[k], **fields)
    rehash(journal)


def move(journal: MemoryJournal, k: int, number: int, /, **fields: Any) -> None:
    """Alter one robot's row in one tick, and make the trace hash agree with it."""
    rows = journal.records[k].robots
    change(journal, k, robots=tuple(replace(row, **fields) if row.number == number else row for row in rows))


def rehash(journal: MemoryJournal) -> None:
    """Make the trace hash agree with the ticks."""
    assert journal.end
    journal.end = replace(journal.end, trace_hash=trace_hash(journal.ticks))


Stop = Callable[[RadioRules, Sent, NDArray[np.int64], Fates], None]
"""What stands in for `RadioRules.stop` where the radio is broken on purpose."""


def stops(*causes: str, origins: Collection[int] | None = None) -> Stop:
    """Rules that stop all frames, or those of some robots' radios, for the first of these causes that is active."""

    def stop(rules: RadioRules, sent: Sent, _receivers: NDArray[np.int64], fates: Fates) -> None:
        hit = np.ones(len(sent.frames), dtype=np.bool_) if origins is None else np.isin(sent.origin, list(origins))
        for entry in rules.timeline.at(sent_at(int(sent.sequence[-1])) if sent.frames else 0):
            if cause(entry) in causes:
                fates.stop(hit[:, None], cause(entry))

    return stop


def spares(spared: Callable[[Sent, NDArray[np.int64]], NDArray[np.bool_]] | None = None) -> Stop:
    """The good rules, which let some frames through all the same; unless told which, all."""
    good = RadioRules.stop

    def stop(rules: RadioRules, sent: Sent, receivers: NDArray[np.int64], fates: Fates) -> None:
        through = fates.on_the_way & (True if spared is None else spared(sent, receivers))
        good(rules, sent, receivers, fates)
        fates.on_the_way |= through
        fates.cause[through] = -1

    return stop


def check_of(kind: type[C], prepared: Prepared, journal: MemoryJournal, timeline: Timeline | None = None) -> C:
    """A check of a run, before its first tick."""
    return JudgedRun(journal, prepared, timeline or Timeline(prepared.scenario), {}).reading(kind)


def result_of(kind: type[Check], prepared: Prepared, journal: MemoryJournal) -> CheckResult:
    """The result of one check of a run."""
    run = JudgedRun(journal, prepared, Timeline(prepared.scenario), {})
    check = run.reading(kind)
    for record in journal.ticks:
        run.tick(record)
    return check.result()
