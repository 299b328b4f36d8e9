"""The comparison of a summary with what its journal gives: which of its fields somebody has changed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

WALL_TIMES = ("wall_s", "realtime_factor")
"""The fields that a journal gives for a run of processes only."""

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
    are compared that both have, by name; a check that only one of them could judge is left out. The exit codes of the
    processes are in no journal, so they are not compared.

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


def _between_verdicts(stated: Mapping[str, Any], found: Mapping[str, Any]) -> Iterator[Difference]:
    for field in ("outcome", "valid", "warnings"):
        if field in stated:
            yield from _between(stated[field], found[field], f"verdict.{field}")
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
