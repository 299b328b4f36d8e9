from collections.abc import Callable
from typing import Any

import pytest

from patrol.journal import Event, Status
from tests.worldsim.checks.judged import Result, move
from tests.worldsim.conftest import Lab
from worldsim.checks.check import CheckResult
from worldsim.run_record import MemoryJournal
from worldsim.verdict.judge import judge

SILENCE = {"kind": "silence", "who": "r1", "at": 2, "for": 3}
WIDE = {"range": 40.0, "line_of_sight": False}


def run(lab: Lab, fault: dict[str, Any] = SILENCE, sensor: dict[str, Any] = WIDE) -> Result:
    return lab.driven(sensor=sensor, faults=[fault])


def recovery(result: Result, baseline_s: float | None) -> CheckResult:
    world, journal = result
    (check,) = [c for c in judge(journal, {}, world.prepared, baseline_s=baseline_s).checks if c.name == "recovery"]
    return check


def test_who_sees_everything_at_once_recovers(lab: Lab) -> None:
    seen = "every point was seen again in 0 s; at most 10 s are allowed"
    assert recovery(run(lab), 2.0) == CheckResult("recovery", True, seen)


def test_a_point_that_is_not_seen_again_in_time_fails(lab: Lab) -> None:
    world, journal = run(lab, sensor={"range": 2.0})
    verdict = judge(journal, {}, world.prepared, baseline_s=2.9)
    assert verdict.outcome == "invalid"
    late = "not every point was seen again; at most 14.5 s are allowed"
    assert verdict.failed == (CheckResult("recovery", False, late),)


def test_to_recover_too_late_fails(lab: Lab) -> None:
    """All stand in one corner when the fault ends, and some time later one in each."""
    result = run(lab, sensor={"range": 12.0, "line_of_sight": False})
    corners = [(1.0, 1.0), (19.0, 1.0), (1.0, 14.0), (19.0, 14.0)]
    for k in range(10, 40):
        for number, (x, y) in enumerate(corners if k >= 31 else corners[:1] * 4, start=1):
            move(result[1], k, number, x=x, y=y)
    late = "every point was seen again in 10.5 s; at most 10 s are allowed"
    assert recovery(result, 2.0) == CheckResult("recovery", False, late)
    assert recovery(result, 2.1).ok


@pytest.mark.parametrize(
    ("fault", "reach", "baseline_s", "why"),
    [
        ({**SILENCE, "for": None}, WIDE, 1.0, "a fault lasts to the end"),
        (SILENCE, WIDE, None, "every point was seen again in 0 s; there is no fault-free run to compare with"),
        (
            SILENCE,
            {"range": 2.0},
            3.1,
            "the run goes on for less than 15.5 s after the faults, 5 x the fault-free MFoW",
        ),
    ],
    ids=["no end", "no comparison", "too short"],
)
def test_what_cannot_be_judged_is_ok_and_says_so(
    lab: Lab, fault: dict[str, Any], reach: dict[str, Any], baseline_s: float | None, why: str
) -> None:
    assert recovery(run(lab, fault, reach), baseline_s) == CheckResult(
        "recovery", True, f"not judged: {why}", judged=False
    )


def gone(journal: MemoryJournal, ticks: range, status: Status) -> None:
    """Let the last robot have another status in some ticks."""
    for k in ticks:
        move(journal, k, 4, status=status)


def test_a_robot_that_comes_some_ticks_after_the_last_fault_does_not_prevent_judging(lab: Lab) -> None:
    """A process that is started again is there some ticks later; recovery counts from then on."""
    result = run(lab)
    gone(result[1], range(10, 17), Status.DEAD)
    seen = "every point was seen again in 0 s; at most 10 s are allowed"
    assert recovery(result, 2.0) == CheckResult("recovery", True, seen)
    short = run(lab, sensor={"range": 2.0})
    gone(short[1], range(10, 30), Status.DEAD)
    detail = "not judged: the run goes on for less than 5 s after the faults, 5 x the fault-free MFoW"
    assert recovery(short, 1.0).detail == detail


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (lambda journal: gone(journal, range(10, 40), Status.LEFT), "r4 is still away at the end, after all faults"),
        (lambda journal: journal.records.__delitem__(slice(8, None)), "the run ended before all faults were over"),
        (lambda journal: journal.write(Event(20, "fault", None, "f2 begins")), "a fault was added at tick 20"),
    ],
    ids=["never whole again", "ends before the healing", "a later fault"],
)
def test_what_leaves_no_time_to_recover_is_not_judged(
    lab: Lab, spoil: Callable[[MemoryJournal], None], why: str
) -> None:
    result = run(lab)
    spoil(result[1])
    assert recovery(result, 2.0).detail == f"not judged: {why}"
