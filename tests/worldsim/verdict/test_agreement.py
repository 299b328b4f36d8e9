"""The comparison of a stated verdict with one that could not repeat all of its checks."""

from typing import Any

import pytest

from worldsim.checks.check import TAGS_NOT_JUDGED
from worldsim.verdict.agreement import WALL_TIMES, differences, missing, not_repeated

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


@pytest.mark.parametrize("ok", [True, False])
def test_a_check_that_has_gone_is_not_repeated(ok: bool) -> None:
    stated = summary("valid" if ok else "invalid", check(True), check(ok, name="transcripts"))
    found = summary("valid", check(True))
    assert differences(stated, found) == []
    assert not_repeated(stated, found) == ["transcripts"]


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


def test_the_warnings_of_a_check_that_an_earlier_version_lacked_are_not() -> None:
    stated = summary("valid", check(True))
    assert differences(stated, summary("valid", check(True), check(True, warnings=(WARNED,), name="router"))) == []


@pytest.mark.parametrize(("says", "agrees"), [("80 frames agree", True), ("81 frames agree", False)])
def test_tags_that_cannot_be_judged_without_the_key_are_no_difference(says: str, agrees: bool) -> None:
    stated = summary("valid", {**check(True, name="frames"), "detail": says})
    without_key = f"80 frames agree{TAGS_NOT_JUDGED}radio.key: cannot read"
    found = summary("valid", {**check(True, name="frames"), "detail": without_key})
    assert (differences(stated, found) == []) is agrees


@pytest.mark.parametrize(("share", "agrees"), [(0.0, True), (0.5, False)])
def test_a_share_of_no_time_was_once_zero(share: float, agrees: bool) -> None:
    def battery(patrol_share: float | None) -> dict[str, Any]:
        return {**summary("valid", check(True)), "robots": {"r3": {"battery": {"patrol_share": patrol_share}}}}

    assert (differences(battery(share), battery(None)) == []) == agrees


FOUND = {
    **summary("valid", check(True), check(True, name="moves")),
    "ticks": 5,
    "robots": {"r1": {"status": "alive", "frames": 5}},
}


@pytest.mark.parametrize(
    ("changes", "fields"),
    [
        ({"robots": {**FOUND["robots"], "r9": {"status": "alive"}}}, {"robots.r9"}),
        ({"prize": 1}, {"prize"}),
        ({"exit_codes": {"r1": 0}}, set()),
        ({"verdict": summary("valid", check(True), check(False, name="style"))["verdict"]}, {"verdict.checks.style"}),
        ({"verdict": summary("valid", check(True, judged=False))["verdict"]}, {"verdict.checks.recovery.judged"}),
    ],
)
def test_what_was_added_or_changed_is_a_difference(changes: dict[str, Any], fields: set[str]) -> None:
    assert {one.field for one in differences({**FOUND, **changes}, FOUND)} == fields


def test_fields_and_checks_that_an_earlier_version_did_not_write_are_missing() -> None:
    stated = {**FOUND, "verdict": summary("valid", check(True))["verdict"]}
    del stated["ticks"]
    assert differences(stated, FOUND) == []
    assert missing(stated, FOUND) == ["verdict.checks.moves", "ticks"]
    assert missing(FOUND, FOUND) == []
    assert missing({**FOUND, "robots": {}}, FOUND) == ["robots.r1"]
    nested = {**FOUND, "robots": {"r1": {"status": "alive"}}, "verdict": {**FOUND["verdict"]}}
    del nested["verdict"]["outcome"]
    assert differences(nested, FOUND) == []
    assert missing(nested, FOUND) == ["verdict.outcome", "robots.r1.frames"]
    assert "verdict" in missing({}, FOUND)
