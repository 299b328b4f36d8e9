"""Compares a summary with the one computed from its journal."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from worldsim.checks.check import TAGS_NOT_JUDGED

WALL_TIMES = ("wall_s", "realtime_factor")
"""Fields that only a journal with an end gives, and of a run in one process only since version 0.2.0."""

GONE = frozenset({"transcripts"})
"""Checks of verdicts up to 1.0.0 that have gone: they are not repeated."""

NOT_IN_JOURNAL = ("exit_codes",)
"""Fields that no journal gives."""

ROUNDING = 1e-9
"""Relative difference of two numbers that are equal but for the machines that computed them."""


NONE_WAS_ZERO = ".battery.patrol_share"
"""A field that is None where version 1.0.0 stated 0, for robots that took no part."""


@dataclass(frozen=True, slots=True)
class Difference:
    """A field in which a summary differs from its journal."""

    field: str  # dotted name
    stated: Any  # in the summary; None where that lacks the field
    found: Any  # from the journal; None where that gives no such field


def differences(stated: Mapping[str, Any], found: Mapping[str, Any]) -> list[Difference]:
    """Compare a summary with one that was made from the journal, field by field, in their order.

    Of the verdict's checks, those are compared that both have, by name. A check that was judged after the run and could
    not be judged again is left out, with its warnings and with what follows from its failure, and so are the warnings
    of checks that the stated verdict lacks. Exit codes are in no journal and are not compared. A field or a check that
    the stated summary lacks, at any depth, is no difference: earlier versions wrote fewer. `missing` lists these.

    `found` is from `worldsim.output.summary.summarise`, as JSON gives it back.
    """
    unknown = [name for name in WALL_TIMES if found[name] is None]
    differing: list[Difference] = []
    for name, value in stated.items():
        if name == "verdict" and isinstance(value, Mapping):
            differing += _between_verdicts(value, found["verdict"])
        # The journal gives None for these, which says nothing about the stated figure.
        elif name not in NOT_IN_JOURNAL and name not in unknown:
            differing += _between(value, found[name], name) if name in found else [Difference(name, value, None)]
    return differing


def missing(stated: Mapping[str, Any], found: Mapping[str, Any]) -> list[str]:
    """List the fields that the journal gives and the summary does not state, such as ``robots.r1.frames``."""
    return list(_missing(_by_name(stated), _by_name(found), ""))


def _by_name(summary: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a summary whose verdict has its checks by name."""
    verdict = summary.get("verdict")
    if not isinstance(verdict, Mapping):
        return summary
    return {**summary, "verdict": {**verdict, "checks": {check["name"]: check for check in verdict["checks"]}}}


def _missing(stated: Any, found: Any, prefix: str) -> Iterator[str]:
    if isinstance(stated, Mapping) and isinstance(found, Mapping):
        for name, value in found.items():
            if name in stated:
                yield from _missing(stated[name], value, f"{prefix}{name}.")
            else:
                yield f"{prefix}{name}"
    elif isinstance(stated, list) and isinstance(found, list) and len(stated) == len(found):
        for index, pair in enumerate(zip(stated, found, strict=True)):
            yield from _missing(*pair, f"{prefix}{index}.")


def not_repeated(stated: Mapping[str, Any], found: Mapping[str, Any]) -> list[str]:
    """Return the names of the checks whose result the summary states, and that could not be judged again.

    These checks need a second run without faults, or the fleet's key, or have gone.
    """
    verdict = stated.get("verdict")
    return [check["name"] for check in _unrepeated(verdict, found["verdict"])] if isinstance(verdict, Mapping) else []


def _unrepeated(stated: Mapping[str, Any], found: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the stated results of checks that could not be judged again."""
    unjudged = GONE | {check["name"] for check in found["checks"] if not check["judged"]}
    return [check for check in stated["checks"] if check["name"] in unjudged and check.get("judged", True)]


def _between_verdicts(stated: Mapping[str, Any], found: Mapping[str, Any]) -> Iterator[Difference]:
    unrepeated = _unrepeated(stated, found)
    failed = found["outcome"] == "valid" and any(not check["ok"] for check in unrepeated)
    for field, if_failed in (("outcome", "invalid"), ("valid", False)):
        if field in stated and not (failed and stated[field] == if_failed):
            yield from _between(stated[field], found[field], f"verdict.{field}")
    if "warnings" in stated:
        unchecked = [line for check in unrepeated for line in check.get("warnings", ())]
        warnings = [line for line in stated["warnings"] if line not in unchecked]
        names = {check["name"] for check in stated["checks"]}
        comparable = [line for check in found["checks"] if check["name"] in names for line in check["warnings"]]
        yield from _between(warnings, comparable, "verdict.warnings")
    checks = {check["name"]: check for check in found["checks"]}
    for stated_check in stated["checks"]:
        field = f"verdict.checks.{stated_check['name']}"
        check = checks.get(stated_check["name"])
        if check is None:
            if stated_check["name"] not in GONE:
                yield Difference(field, stated_check, None)
        elif check["judged"] or not stated_check.get("judged", True):
            again = {**check, "detail": check["detail"].partition(TAGS_NOT_JUDGED)[0]}
            for part in ("ok", "judged", "detail"):
                yield from _between(stated_check.get(part, True), again[part], f"{field}.{part}")


def _between(stated: Any, found: Any, field: str) -> Iterator[Difference]:
    if isinstance(stated, Mapping) and isinstance(found, Mapping):
        for name in stated:
            yield from _between(stated[name], found.get(name), f"{field}.{name}")
        return
    if isinstance(stated, Sequence) and isinstance(found, Sequence) and not isinstance(stated, str):
        if len(stated) == len(found):
            for index, (stated_item, found_item) in enumerate(zip(stated, found, strict=True)):
                yield from _between(stated_item, found_item, f"{field}.{index}")
            return
    elif _is_number(stated) and _is_number(found):
        if math.isclose(stated, found, rel_tol=ROUNDING):
            return
    elif stated == found or (stated == 0.0 and found is None and field.endswith(NONE_WAS_ZERO)):
        return
    yield Difference(field, stated, found)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
