"""Reads summary.json: each value must be of the type that `patrol.summary.model` declares."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path

from pydantic import ValidationError

from patrol.errors import BadInput, quoted
from patrol.files.untrusted import SUMMARY, read_untrusted, refuse_half_characters
from patrol.summary.model import Summary

DEEPEST = 50
"""Mappings and lists within each other; a summary has six."""
TOO_DEEP = "is nested too deeply for a summary; remove or restore it"


def read_summary(path: Path) -> Summary | None:
    """Read summary.json; return None where it is missing or, because the run was killed, incomplete."""
    try:
        document = json.loads(read_untrusted(path, SUMMARY), parse_int=_read_integer, parse_constant=_no_number)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise BadInput(f"{path}: cannot be read ({error.strerror}); remove or restore it") from None
    except RecursionError:
        raise BadInput(f"{path}: {TOO_DEEP}") from None
    except ValueError:
        return None
    if not isinstance(document, dict):
        raise BadInput(f"{path}: holds {quoted(document)}, which is no summary; remove or restore it")
    for field, value, depth in _walk_values(document):
        if depth > DEEPEST:
            raise BadInput(f"{path}: {TOO_DEEP}")
        if isinstance(value, float) and not math.isfinite(value):
            raise BadInput(f"{path}: {field} is too large for a number; remove or restore the file")
    refuse_half_characters(document, str(path))
    try:
        return Summary.model_validate(document)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        field = ".".join(map(str, first["loc"]))
        wrong = f"{field} = {quoted(first['input'])}: {first['msg'][:1].lower()}{first['msg'][1:]}"
        raise BadInput(f"{path}: {wrong}; remove or restore the file") from None


def _walk_values(document: object) -> Iterator[tuple[str, object, int]]:
    """Yield all values of a JSON document, each with its dotted field and its depth; nothing below `DEEPEST`."""
    waiting = [("", document, 0)]
    while waiting:
        field, node, depth = waiting.pop()
        if isinstance(node, dict) and depth <= DEEPEST:
            waiting += [(f"{field}.{name}" if field else name, value, depth + 1) for name, value in node.items()]
        elif isinstance(node, list) and depth <= DEEPEST:
            waiting += [(f"{field}.{index}", value, depth + 1) for index, value in enumerate(node)]
        else:
            yield field, node, depth


def _read_integer(digits: str) -> int | float:
    """An integer; infinity for one that is too large for a float, which the search for such values then refuses."""
    number = float(digits)
    return int(digits) if math.isfinite(number) else number


def _no_number(constant: str) -> float:
    raise BadInput(f"summary.json: holds {constant} instead of a number; remove or restore it")
