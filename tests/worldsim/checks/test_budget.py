"""The verdict on a fleet that saves on its radio: bits are counted, and nobody is silent who should not be."""

from dataclasses import replace
from typing import Any

import pytest

from fogwatch.inprocess import Outcome, run_in_process
from patrol.journal.records import FORGED, TickRecord
from patrol.prepare import Prepared, prepare
from patrol.radio.message import decode, encode
from patrol.scenario import load_scenario
from tests.worldsim.checks.judged import change, result_of
from worldsim.checks.sent import FramesAreTrue, WithinBudget
from worldsim.run_record import MemoryJournal

SCENARIO: dict[str, Any] = {"terrain": {"builtin": "yards"}, "point": 1.0, "duration": 40}
SCENARIO["robots"] = {"count": 3, "model": "car"}
BUDGET = {"bits_per_s": 900, "overhead": 8}
SAVINGS: dict[str, dict[str, Any]] = {
    "budget": {"budget": BUDGET, "trail": 4, "trail_every": 3},
    "adaptive": {"adaptive": {"error": 1.5}, "trail": 4, "trail_every": 3},
    "both": {"budget": BUDGET, "adaptive": {"error": 1.5}, "trail": 4, "trail_every": 3},
    "standing": {"adaptive": {"error": 4}},
}
INTRUDER = {"place": [40, 22], "at": 10, "for": 15}
PROCESSES = [
    {"kind": "kill", "at": 8, "who": "r2"},
    {"kind": "restart", "at": 14, "who": "r2"},
    {"kind": "pause", "at": 10, "for": 7, "who": "r3"},
    {"kind": "restart", "at": 20, "who": "r1"},
]
SENSES = [
    {"kind": "drift", "who": "r1", "growth": [0.03, 0.01], "noise": 0.1},
    {"kind": "clock", "who": "r2", "offset": 2.0},
    {"kind": "spoof", "at": 5, "for": 10, "as": "r2", "payload": {"offset": [5, 0]}},
]


def run(radio: dict[str, Any], **more: Any) -> tuple[Prepared, MemoryJournal, Outcome]:
    prepared = prepare(load_scenario({**SCENARIO, "radio": radio, **more}))
    outcome = run_in_process(prepared)
    assert isinstance(outcome.journal, MemoryJournal)
    return prepared, outcome.journal, outcome


def without(record: TickRecord, number: int) -> dict[str, Any]:
    """A tick's record without the frames of a robot."""
    return {
        "frames": tuple((source, frame) for source, frame in record.frames if source != number),
        "deliveries": tuple(link for link in record.deliveries if link[0] != number),
    }


@pytest.mark.parametrize("savings", SAVINGS)
@pytest.mark.parametrize("faults", [[], PROCESSES, SENSES], ids=["calm", "processes", "senses"])
def test_runs_that_save_are_valid(savings: str, faults: list[dict[str, Any]]) -> None:
    _, journal, outcome = run(SAVINGS[savings], faults=faults, intruders=[INTRUDER])
    assert outcome.verdict.valid, outcome.verdict.failed
    sent = sum(source != FORGED for record in journal.ticks for source, _ in record.frames)
    assert sent < 0.8 * 3 * 80, "it saves"
    named = {check.name: check.detail for check in outcome.verdict.checks}
    assert ("budget" in named) is ("budget" in SAVINGS[savings])
    if "budget" in named:
        assert " of 900 bit/s used, at most " in named["budget"]


@pytest.mark.parametrize("savings", SAVINGS)
def test_a_robot_that_is_silent_when_it_should_not_be_is_found(savings: str) -> None:
    prepared, journal, _ = run(SAVINGS[savings])
    k = next(record.k for record in journal.ticks if record.k > 40 and any(source == 2 for source, _ in record.frames))
    for later in range(k, 80):
        change(journal, later, **without(journal.records[later], 2))
    result = result_of(FramesAreTrue, prepared, journal)
    assert not result.ok
    assert result.detail.startswith("r2 did not send its position in tick ")


def test_a_prediction_that_is_off_must_be_put_right_at_once_where_there_is_no_budget() -> None:
    prepared, journal, _ = run(SAVINGS["adaptive"])
    silence, last, wrong = 8, 0, 0
    for record in list(journal.ticks):
        if all(source != 1 for source, _ in record.frames):
            continue
        if last > 0 and record.k - last < silence:
            before = journal.records[record.k]
            change(journal, record.k, **without(before, 1))
            detail = f"r1 did not send its position in tick {record.k}"
            assert result_of(FramesAreTrue, prepared, journal).detail == detail
            change(journal, record.k, frames=before.frames, deliveries=before.deliveries)
            wrong += 1
        last = record.k
    assert wrong > 5
    assert result_of(FramesAreTrue, prepared, journal).ok


def with_budget(**budget: Any) -> Prepared:
    return prepare(load_scenario({**SCENARIO, "radio": {**SAVINGS["budget"], "budget": {**BUDGET, **budget}}}))


def test_a_robot_that_sends_more_than_its_share_is_found() -> None:
    _, journal, _ = run({**SAVINGS["budget"], "budget": {**BUDGET, "bits_per_s": 10_000}})
    result = result_of(WithinBudget, with_budget(bits_per_s=1200), journal)
    assert " bits more than its share of 400 bit/s by tick " in result.detail


def test_a_burst_at_the_beginning_is_found_and_one_that_was_saved_up_is_not() -> None:
    prepared, journal, _ = run(SAVINGS["budget"])
    frame = next(frame for record in journal.ticks for _, frame in record.frames)
    for k in range(80):
        change(journal, k, frames=())
    change(journal, 60, frames=((1, frame),) * 2)
    assert result_of(WithinBudget, prepared, journal).ok
    change(journal, 60, frames=((1, frame),) * 5)
    assert not result_of(WithinBudget, prepared, journal).ok
    change(journal, 60, frames=())
    change(journal, 0, frames=((1, frame),))
    assert result_of(WithinBudget, prepared, journal).detail.startswith("r1 had sent ")


def test_a_frame_that_is_too_long_is_found() -> None:
    _, journal, _ = run(SAVINGS["budget"])
    for record in list(journal.ticks)[60:]:
        change(journal, record.k, frames=())
    change(journal, 79, frames=((3, bytes(41)),))
    assert result_of(WithinBudget, with_budget(frame=41), journal).ok
    result = result_of(WithinBudget, with_budget(frame=40), journal)
    assert result.detail == "r3 sent 41 bytes in tick 79, at most 40 are allowed"


def test_what_a_forger_sends_is_nobodys_share() -> None:
    prepared, journal, _ = run(SAVINGS["budget"])
    for record in list(journal.ticks):
        change(journal, record.k, frames=(*((FORGED, bytes(60)) for _ in range(10)), *record.frames))
    assert result_of(WithinBudget, prepared, journal).ok


def test_a_trail_that_is_not_where_the_robot_was_is_found() -> None:
    prepared, journal, _ = run(SAVINGS["both"])
    record = next(r for r in journal.ticks if r.k > 30 and any(decode(frame).trail for _, frame in r.frames))
    source, frame = next((s, f) for s, f in record.frames if decode(f).trail)
    said = decode(frame)
    (dx, dy), *rest = said.trail
    lie = encode(replace(said, trail=((dx + 1, dy), *rest)))
    frames = tuple((s, lie if s == source else f) for s, f in record.frames)
    change(journal, record.k, frames=frames)
    assert "the pose gives" in result_of(FramesAreTrue, prepared, journal).detail
