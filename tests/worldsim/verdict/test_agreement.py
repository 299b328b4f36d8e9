"""The comparison of a stated verdict with one that could not repeat all of its checks."""

from __future__ import annotations

from typing import Any

import pytest

from worldsim.verdict.agreement import WALL_TIMES, differences, not_repeated

WARNED = "r1 is slow"


def check(ok: bool, judged: bool = True, warnings: tuple[str, ...] = (), name: str = "recovery") -> dict[str, Any]:
    """A check's result as in summary.json."""
    return {"name": name, "ok": ok, "detail": "", "judged": judged, "warnings": list(warnings)}


def summary(outcome: str, *checks: dict[str, Any]) -> dict[str, Any]:
    """A summary with a verdict alone."""
    warnings = [line for one in checks for line in one["warnings"]]
    verdict = {"outcome": outcome, "valid": outcome == "valid", "warnings": warnings, "checks": list(checks)}
    return {**dict.fromkeys(WALL_TIMES), "verdict": verdict}


def test_what_follows_from_a_check_that_cannot_be_repeated_is_no_difference() -> None:
    stated = summary("invalid", check(False, warnings=(WARNED,)))
    found = summary("valid", check(True, judged=False))
    assert differences(stated, found) == []
    assert not_repeated(stated, found) == ["recovery"]


@pytest.mark.parametrize(
    ("stated", "found"),
    [
        (summary("invalid", check(True)), summary("valid", check(True, judged=False))),
        (summary("invalid", check(False)), summary("unknown", check(True, judged=False))),
        (
            summary("valid", check(False), check(True, name="moves")),
            summary("invalid", check(True, judged=False), check(False, name="moves")),
        ),
    ],
)
def test_an_outcome_that_follows_from_nothing_is_a_difference(stated: dict[str, Any], found: dict[str, Any]) -> None:
    assert "verdict.outcome" in {one.field for one in differences(stated, found)}


def test_the_warnings_of_other_checks_are_compared() -> None:
    stated = summary("invalid", check(False), check(True, warnings=(WARNED,), name="progress"))
    found = summary("valid", check(True, judged=False), check(True, name="progress"))
    assert "verdict.warnings" in {one.field for one in differences(stated, found)}
