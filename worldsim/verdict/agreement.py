"""The comparison of a summary with what its journal gives: which of its fields somebody has changed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

WALL_TIMES = ("wall_s", "realtime_factor")
"""Fields that a journal without an end does not give, nor one of a run in one process of an earlier version."""

ROUNDING = 1e-9
"""Relative difference of two numbers that are equal but for the machines that computed them."""


@dataclass(frozen=True, slots=True)
class Difference:
    """A field in which a summary differs from its journal.

    Attributes:
        field: Its dotted name.
        stated: Its value in the summary.
        found: What the journal gives.
    """

    field: str
    stated: Any
    found: Any


def differences(stated: Mapping[str, Any], found: Mapping[str, Any]) -> list[Difference]:
    """Compare a summary with one that was made from the journal, field by field.

    A field that the stated summary lacks is no difference: earlier versions wrote fewer. Of the verdict's checks, those
    are compared that both have, by name; a check that only one of them could judge is left out, with its warnings and
    with what follows from its failure. The exit codes of the processes are in no journal, so they are not compared.

    Args:
        stated: As in summary.json.
        found: From `worldsim.output.summary.summarise`, as JSON gives it back.

    Returns:
        The differences in the order of the fields.
    """
    unknown = [name for name in WALL_TIMES if found[name] is None]
    rest = {name: value for name, value in found.items() if name not in ("verdict", *unknown)}
    differing = [*_between(stated, rest, "")]
    verdict = stated.get("verdict")
    if isinstance(verdict, Mapping):
        differing += _between_verdicts(verdict, found["verdict"])
    return differing


def not_repeated(stated: Mapping[str, Any], found: Mapping[str, Any]) -> list[str]:
    """Names of the checks that the summary states a result of, and that could not be judged again.

    That is for want of a second run without faults, or of the fleet's key.

    Args:
        stated: As for `differences`.
        found: As for `differences`.
    """
    verdict = stated.get("verdict")
    if not isinstance(verdict, Mapping):
        return []
    return [check["name"] for check in _unrepeated(verdict, found["verdict"])]


def _unrepeated(stated: Mapping[str, Any], found: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The stated results of checks that could not be judged again."""
    unjudged = {check["name"] for check in found["checks"] if not check["judged"]}
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
        yield from _between(warnings, found["warnings"], "verdict.warnings")
    checks = {check["name"]: check for check in stated["checks"]}
    for check in found["checks"]:
        said = checks.get(check["name"])
        if said is not None and said.get("judged", True) == check["judged"]:
            for field in ("ok", "detail"):
                yield from _between(said.get(field), check[field], f"verdict.checks.{check['name']}.{field}")


def _between(stated: Any, found: Any, field: str) -> Iterator[Difference]:
    if isinstance(stated, Mapping) and isinstance(found, Mapping):
        for name, value in found.items():
            if name in stated:
                yield from _between(stated[name], value, f"{field}.{name}" if field else name)
        return
    if isinstance(stated, Sequence) and isinstance(found, Sequence) and not isinstance(stated, str):
        if len(stated) == len(found):
            for place, (one, other) in enumerate(zip(stated, found, strict=True)):
                yield from _between(one, other, f"{field}.{place}")
            return
    elif _is_number(stated) and _is_number(found):
        if math.isclose(stated, found, rel_tol=ROUNDING):
            return
    elif stated == found:
        return
    yield Difference(field, stated, found)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
