"""The check of transcripts: what it says of two that agree, of two that do not, and of none."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest

from tests.worldsim.checks.judged import Result, result_of
from worldsim.checks.journal import TranscriptsAgree
from worldsim.verdict.judge import judge

if TYPE_CHECKING:
    from tests.worldsim.conftest import Lab
    from worldsim.checks.check import CheckResult

TICKS = 12
SAME = ["aa", "aa", "bb", "bb"]


@pytest.fixture
def result(lab: Lab) -> Result:
    world = lab.patrol(ticks=TICKS)
    return world, lab.run(world)


def noted(result: Result, transcripts: Any, **notes: Any) -> CheckResult:
    world, journal = result
    assert journal.end
    journal.end = replace(journal.end, notes={"transcripts": transcripts, **notes})
    return result_of(TranscriptsAgree, world.prepared, journal)


def note(robot: int, *spans: list[Any], incarnation: int = 1, missed: int = 0) -> dict[str, Any]:
    counts = {"asked": TICKS - 1, "messages": 48, "missed": missed}
    return {"robot": robot, "incarnation": incarnation, **counts, "spans": list(spans)}


def test_only_runs_of_processes_have_some(result: Result) -> None:
    world, journal = result
    assert not [check for check in judge(journal, {}, world.prepared).checks if check.name == "transcripts"]
    (check,) = (
        check for check in judge(journal, {"the world": 0}, world.prepared).checks if check.name == "transcripts"
    )
    assert (check.ok, check.judged) == (True, False)
    assert check.detail == "not judged: the journal holds none, as those of earlier versions"


def test_two_that_agree_are_good(result: Result) -> None:
    check = noted(result, [note(1, [0, 11, *SAME]), note(2, [0, 11, *SAME])])
    assert (check.ok, check.judged) == (True, True)
    assert check.detail == "the same by the robots and the world, 96 messages"


def test_what_was_not_compared_is_said(result: Result) -> None:
    check = noted(result, [note(1, [0, 7, *SAME]), note(2), note(2, [4, 11, *SAME], incarnation=2, missed=3)])
    assert check.ok
    assert check.warnings == ("r2 (2): no report has come of 3 replies that the world acted on",)
    left_out = "r1 from tick 8, r2 from tick 0, 3 replies of r2 (2), whose reports were lost"
    assert check.detail.endswith(f"; not compared: {left_out}")


@pytest.mark.parametrize(
    ("hashes", "problem"),
    [
        (["xx", "aa", "bb", "bb"], "the robot acted on phases that the world had not sent"),
        (["aa", "aa", "bb", "xx"], "the world acted on replies that the robot had not sent"),
    ],
)
def test_a_difference_names_robot_and_ticks(result: Result, hashes: list[str], problem: str) -> None:
    spans = [[8, 11, *SAME], [4, 7, *hashes], [0, 3, *SAME]]
    check = noted(result, [note(1, [0, 11, *SAME]), note(2, *spans, incarnation=2)])
    assert not check.ok
    assert check.detail == f"r2 (2): in ticks 4 to 7 {problem}"
    world, journal = result
    assert judge(journal, {}, world.prepared).outcome == "invalid"


@pytest.mark.parametrize(
    "wrong",
    [
        5,
        None,
        [5],
        [{}],
        [{**note(1), "spans": [[1, 2]]}],
        [{**note(1), "asked": "x"}],
        [{**note(1), "asked": math.inf}],
    ],
)
def test_what_cannot_be_read_fails(result: Result, wrong: Any) -> None:
    check = noted(result, wrong)
    assert (check.ok, check.detail) == (False, "what the journal holds cannot be read")


def test_a_report_that_is_missing_for_no_reason_is_a_warning(result: Result) -> None:
    """Not where the router was down: then reports are lost with everything else."""
    unreported = {**note(1, [0, 7, *SAME], missed=4), "closed": False}
    world, journal = result
    noted(result, [unreported])
    verdict = judge(journal, {"r1": 0}, world.prepared)
    gone = "r1: no report has come of 4 replies that the world acted on"
    assert verdict.warnings[-2:] == (gone, "r1 ended in order, and its last report has not come")
    noted(result, [unreported])
    assert judge(journal, {"r1": -9}, world.prepared).warnings[-1:] == (gone,)
    assert not noted(result, [unreported], router_silent_s=2.5).warnings


@pytest.mark.parametrize(("pace", "silent_s", "warns"), [(8, 20.1, True), (8, 1.0, False), ("lockstep", 20.1, False)])
def test_a_router_that_stood_still_is_named_where_the_world_did_not_wait(
    lab: Lab, pace: Any, silent_s: float, warns: bool
) -> None:
    world = lab.patrol(ticks=4, pace=pace)
    journal = lab.run(world)
    assert journal.end is not None
    journal.end = replace(journal.end, notes={"router_silent_s": silent_s, "late_commands": {1: 300, 2: 20}})
    warning = (
        "the router did not answer for 20 s of wall time, in which robots stood still and heard nothing; over the "
        "whole run 320 commands did not come in time"
    )
    assert (warning in judge(journal, {}, world.prepared).warnings) == warns
