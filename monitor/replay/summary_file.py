"""Reads summary.json, checked as far as a report uses it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from patrol.errors import BadInput, quoted
from patrol.half_characters import refuse_half_characters
from patrol.untrusted import SUMMARY, read_untrusted


class _Part(BaseModel):
    """A mapping of which some entries are used; others may be there."""

    model_config = ConfigDict(strict=True, extra="allow", allow_inf_nan=False)


class _Stalest(_Part):
    x: float
    y: float
    age_s: float
    at_s: float
    seen: bool
    nearest: str | None
    nearest_m: float | None


class _Places(_Part):
    worst: _Stalest | None = None
    end: _Stalest | None = None


class _Check(_Part):
    name: str
    ok: bool
    detail: str = ""
    judged: bool = True
    warnings: list[str] = []


class _Verdict(_Part):
    outcome: str = "unknown"
    warnings: list[str] = []
    checks: list[_Check]


class _Effects(_Part):
    frames: int = 0
    dropped: int | None = None
    delayed: int | None = None
    duplicated: int | None = None


class _Counts(_Part):
    sent: int
    heard: int


class _Direct(_Part):
    heard_share: float | None = None
    links: dict[str, _Counts] = {}
    unsaid: list[str] = []


class _Intruder(_Part):
    first_reported_s: float | None
    reported_s: float
    surrounded_s: float
    most_robots: int


class _Summary(_Part):
    trace_hash: str | None = None
    mfow_mean_s: float | None = None
    exit_codes: dict[str, int | None] | None = None
    verdict: _Verdict | None = None
    stalest: _Places | None = None
    faults: dict[str, _Effects] | None = None
    direct: _Direct | None = None
    intruders: list[_Intruder] | None = None


def read_summary(path: Path) -> Mapping[str, Any] | None:
    """The content of summary.json.

    Args:
        path: The file.

    Returns:
        The content; None where there is no file, or where it is not complete, because the run was killed.

    Raises:
        BadInput: It is no regular file, too large, or holds something else than a summary.
    """
    try:
        says = json.loads(read_untrusted(path, SUMMARY), parse_int=_integer, parse_constant=_no_number)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise BadInput(f"{path}: cannot be read ({error.strerror}); remove or restore it") from None
    except RecursionError:
        raise BadInput(f"{path}: is nested too deeply for a summary; remove or restore it") from None
    except ValueError:
        return None
    if not isinstance(says, dict):
        raise BadInput(f"{path}: holds {quoted(says)}, which is no summary; remove or restore it")
    refuse_half_characters(says, str(path))
    for field, value in _values(says, ""):
        if isinstance(value, float) and not math.isfinite(value):
            raise BadInput(f"{path}: {field} is too large for a number; remove or restore the file")
    try:
        _Summary.model_validate(says)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        field = ".".join(map(str, first["loc"]))
        wrong = f"{field} = {quoted(first['input'])}: {first['msg'][:1].lower()}{first['msg'][1:]}"
        raise BadInput(f"{path}: {wrong}; remove or restore the file") from None
    return says


def _values(node: object, field: str) -> Iterator[tuple[str, object]]:
    """Yield all values of a JSON document, each with its dotted field."""
    waiting = [(field, node)]
    while waiting:
        field, node = waiting.pop()
        if isinstance(node, dict):
            waiting += [(f"{field}.{name}" if field else name, value) for name, value in node.items()]
        elif isinstance(node, list):
            waiting += [(f"{field}.{place}", value) for place, value in enumerate(node)]
        else:
            yield field, node


def _integer(digits: str) -> int | float:
    """An integer; infinity for one that is too large for a float, which the search for such values then refuses."""
    number = float(digits)
    return int(digits) if math.isfinite(number) else number


def _no_number(constant: str) -> float:
    raise BadInput(f"summary.json: holds {constant} instead of a number; remove or restore it")
