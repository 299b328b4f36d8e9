from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest

from patrol.journal import Event, Status
from worldsim.checks.check import CheckResult
from worldsim.run_record import MemoryJournal
from worldsim.verdict.judge import Judge, judge

if TYPE_CHECKING:
    from tests.worldsim.conftest import Lab
    from worldsim.world import World

SILENCE = {"kind": "silence", "who": "r1", "at": 2, "for": 3}
WIDE = {"range": 40.0, "line_of_sight": False}


def world(lab: Lab, *faults: dict[str, Any], ticks: int = 40, sensor: dict[str, Any] = WIDE) -> World:
    return lab.patrol(ticks=ticks, sensor=sensor, faults=list(faults))


def recovery(world: World, journal: MemoryJournal, baseline_s: float | None) -> CheckResult:
    judging = Judge(journal, {}, world.prepared, baseline_s=baseline_s)
    for record in journal.ticks:
        judging.tick(record)
    (check,) = [check for check in judging.verdict().checks if check.name == "recovery"]
    return check


def test_who_sees_everything_at_once_recovers(lab: Lab) -> None:
    found = world(lab, SILENCE)
    check = recovery(found, lab.run(found), 2.0)
    assert check == CheckResult("recovery", True, "every point was seen again in 0 s; at most 10 s are allowed")


def test_a_point_that_is_not_seen_again_in_time_fails(lab: Lab) -> None:
    found = world(lab, SILENCE, sensor={"range": 2.0})
    journal = lab.run(found)
    check = recovery(found, journal, 2.9)
    assert check == CheckResult("recovery", False, "not every point was seen again; at most 14.5 s are allowed")
    verdict = judge(journal, {}, found.prepared, baseline_s=2.9)
    assert verdict.outcome == "invalid"
    assert [failed.name for failed in verdict.failed] == ["recovery"]


def test_to_recover_too_late_fails(lab: Lab) -> None:
    """All stand in one corner when the fault ends, and some time later one in each."""
    found = world(lab, SILENCE, sensor={"range": 12.0, "line_of_sight": False})
    journal = lab.run(found)
    corners = [(1.0, 1.0), (19.0, 1.0), (1.0, 14.0), (19.0, 14.0)]
    for k in range(10, 40):
        places = corners if k >= 31 else corners[:1] * 4
        robots = zip(journal.records[k].robots, places, strict=True)
        journal.records[k] = replace(journal.records[k], robots=tuple(replace(row, x=x, y=y) for row, (x, y) in robots))
    late = recovery(found, journal, 2.0)
    assert late == CheckResult("recovery", False, "every point was seen again in 10.5 s; at most 10 s are allowed")
    assert recovery(found, journal, 2.1).ok


@pytest.mark.parametrize(
    ("fault", "baseline_s", "why"),
    [
        ({**SILENCE, "for": None}, 1.0, "a fault lasts to the end"),
        (SILENCE, None, "every point was seen again in 0 s; there is no fault-free run to compare with"),
    ],
)
def test_what_cannot_be_judged_is_ok_and_says_so(
    lab: Lab, fault: dict[str, Any], baseline_s: float | None, why: str
) -> None:
    found = world(lab, fault)
    check = recovery(found, lab.run(found), baseline_s)
    assert check == CheckResult("recovery", True, f"not judged: {why}", judged=False)


def test_a_quiet_window_that_is_too_short_is_not_judged(lab: Lab) -> None:
    found = world(lab, SILENCE, sensor={"range": 2.0})
    check = recovery(found, lab.run(found), 3.1)
    assert check.detail == "not judged: the run goes on for less than 15.5 s after the faults, 5 x the fault-free MFoW"
    assert not check.judged
    assert check.ok


def gone(journal: MemoryJournal, ticks: range, status: Status) -> None:
    """Let the last robot have another status in some ticks."""
    for k in ticks:
        robots = journal.records[k].robots
        journal.records[k] = replace(journal.records[k], robots=(*robots[:3], replace(robots[3], status=status)))


def test_a_fleet_that_is_never_whole_again_is_not_judged(lab: Lab) -> None:
    found = world(lab, SILENCE)
    journal = lab.run(found)
    gone(journal, range(10, 40), Status.LEFT)
    assert recovery(found, journal, 2.0).detail == "not judged: r4 is still away at the end, after all faults"


def test_a_robot_that_comes_some_ticks_after_the_last_fault_does_not_prevent_judging(lab: Lab) -> None:
    """A process that is started again is there some ticks later; recovery counts from then on."""
    found = world(lab, SILENCE)
    journal = lab.run(found)
    gone(journal, range(10, 17), Status.DEAD)
    seen = "every point was seen again in 0 s; at most 10 s are allowed"
    assert recovery(found, journal, 2.0) == CheckResult("recovery", True, seen)
    short = world(lab, SILENCE, sensor={"range": 2.0})
    journal = lab.run(short)
    gone(journal, range(10, 30), Status.DEAD)
    detail = "not judged: the run goes on for less than 5 s after the faults, 5 x the fault-free MFoW"
    assert recovery(short, journal, 1.0).detail == detail


def test_a_run_that_ends_before_the_healing_is_not_judged(lab: Lab) -> None:
    found = world(lab, SILENCE)
    journal = lab.run(found)
    del journal.records[8:]
    assert recovery(found, journal, 2.0).detail == "not judged: the run ended before all faults were over"


def test_a_later_fault_that_somebody_asked_for_is_not_judged(lab: Lab) -> None:
    found = world(lab, SILENCE)
    journal = lab.run(found)
    journal.write(Event(20, "fault", None, "f2 silence begins: r2"))
    assert recovery(found, journal, 2.0).detail == "not judged: a fault was added at tick 20"


def test_a_run_without_faults_has_no_such_check(lab: Lab) -> None:
    found = world(lab)
    assert "recovery" not in {check.name for check in judge(lab.run(found), {}, found.prepared).checks}
