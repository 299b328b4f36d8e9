"""Runs of a lab under faults, altered afterwards, and what their verdict says of them."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from patrol.journal import trace_hash
from patrol.journal.records import sent_at
from worldsim.checks.check import Check, CheckResult, JudgedRun
from worldsim.faults import Timeline
from worldsim.radio.fates import Fates, Sent
from worldsim.radio.rules import RadioRules, cause
from worldsim.verdict.judge import judge

if TYPE_CHECKING:
    from patrol.prepare import Prepared
    from tests.worldsim.conftest import Lab
    from worldsim.run_record import MemoryJournal
    from worldsim.world import World

Result = tuple["World", "MemoryJournal"]
C = TypeVar("C", bound=Check)


def runs(lab: Lab, ticks: int) -> Callable[..., Result]:
    """What makes a run of so many ticks, unless told otherwise, under faults."""

    def of(*faults: dict[str, Any], ticks: int = ticks, **more: Any) -> Result:
        world = lab.patrol(ticks=ticks, faults=list(faults), **more)
        return world, lab.run(world)

    return of


def failures(result: Result) -> dict[str, str]:
    """The details of the checks that failed, by name."""
    world, journal = result
    return {check.name: check.detail for check in judge(journal, {}, world.prepared).failed}


def change(journal: MemoryJournal, k: int, **fields: Any) -> None:
    """Alter one tick's record, and make the trace hash agree with it."""
    journal.records[k] = replace(journal.records[k], **fields)
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
