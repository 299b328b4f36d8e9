"""Areas of a scenario, as zones and closures are: polygons, times, names, and lists in files of their own."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, ValidationInfo

from patrol.errors import BadInput
from patrol.files.yaml_text import parse_yaml, read_text
from patrol.values import NotNegative, absolute, at_most, wrong

MOST_TIMES = 10_000
"""Times of one zone or closure, at most."""

Span = tuple[NotNegative, NotNegative]
"""From and to, s."""

Spans = Annotated[tuple[Span, ...], at_most(MOST_TIMES, "spans")]


def is_in_one_of(spans: Sequence[Span], time_s: float) -> bool:
    """Return True if a time lies in one of some spans of time, which `check_spans` has passed.

    A span includes its beginning and excludes its end.
    """
    index = bisect_right(spans, (time_s, math.inf))
    return index > 0 and time_s < spans[index - 1][1]


def holds_tick(span: Span, step: float) -> bool:
    """Return True if a span of time (s) holds a tick; its end is excluded."""
    first, end = span
    k = math.ceil(first / step)
    if (k - 1) * step >= first:  # the quotient was rounded up
        k -= 1
    elif k * step < first:  # it was rounded down
        k += 1
    return k * step < end


def check_spans(spans: Sequence[Span], field: str, name: str) -> None:
    """Raise unless spans of time come one after the other, with time between them."""
    before = 0.0
    for number, (first, end) in enumerate(spans):
        if end <= first:
            raise wrong(f"{field}.{number}", f"{name}: ends at {end:g} s, not after its begin; correct it")
        if number and first <= before:
            raise wrong(f"{field}.{number}", f"{name}: begins before the one before it is over; sort or join them")
        before = end


def check_ticks(spans: Sequence[Span], step: float, field: str, name: str) -> None:
    """Refuse spans of time between two ticks."""
    for first, end in spans:
        if not holds_tick((first, end), step):
            limit = f"{name}: {first:g} to {end:g} s holds no tick of {step:g} s; make it longer"
            raise wrong(field, limit)


def check_names(names: Sequence[str], what: str) -> None:
    """Refuse two of one name."""
    for number, name in enumerate(names):
        if name in names[:number]:
            raise wrong(f"{what}s.{number}.name", f"{name} is the name of another {what} too; rename one")


def has_area(polygon: Sequence[tuple[float, float]]) -> bool:
    """Return True if the corners of a polygon do not all lie on one line."""
    (x, y), *corners = polygon
    sides = [(to_x - x, to_y - y) for to_x, to_y in corners]
    across, up = max(sides, key=lambda side: math.hypot(*side))
    return any(abs(across * to_up - up * to_across) > 1e-9 * (across**2 + up**2) for to_across, to_up in sides)


def listed_in_file(key: str, example: str) -> BeforeValidator:
    """Let a field name the YAML file that holds its list; any other value stays as it is.

    The file holds a list, or a mapping with a list named `key`, the field's name, such as a scenario. The masks of its
    entries lie relative to it. `example` is an entry, for the error.
    """

    def read(value: Any, info: ValidationInfo) -> Any:
        if not isinstance(value, str):
            return value
        path = Path(absolute(value, info))
        try:
            says = parse_yaml(read_text(path), str(path))
        except BadInput as error:
            raise wrong("", str(error)) from None
        listed = says.get(key) if isinstance(says, dict) else says
        if not isinstance(listed, list):
            raise wrong("", f"{path}: holds no list of {key}; write for example '- {example}'")
        return [
            {**entry, "mask": str((path.parent / entry["mask"]).absolute())}
            if isinstance(entry, dict) and isinstance(entry.get("mask"), str)
            else entry
            for entry in listed
        ]

    return BeforeValidator(read)
