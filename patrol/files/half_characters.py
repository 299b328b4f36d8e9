r"""Lone surrogates: halves of characters, which JSON, YAML and Python spell (``"\ud800"``) but no text can hold.

They cannot be encoded in UTF-8, so whatever writes, sends or hashes them fails, far from where they came in. Readers of
other people's text refuse them here.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from patrol.errors import BadInput, quoted

REMEDY = "holds half of a character (a lone surrogate, or a byte that is not UTF-8); write whole characters"


def refuse_half_characters(value: Any, source: str) -> None:
    """Refuse lone surrogates in the keys and values of plain data."""
    waiting: list[tuple[str, Any]] = [("", value)]
    seen_ids: set[int] = set()
    while waiting:
        field, part = waiting.pop()
        inner: list[tuple[Any, Any]] = []
        if isinstance(part, str) and _is_half(part):
            where = f"{source}: {field} = " if field else f"{source}: "
            raise BadInput(f"{where}{quoted(part)}: {REMEDY}")
        if isinstance(part, Mapping | list | tuple) and id(part) not in seen_ids:
            seen_ids.add(id(part))
            inner = list(part.items() if isinstance(part, Mapping) else enumerate(part))
        for key, child in reversed(inner):
            if isinstance(key, str) and _is_half(key):
                raise BadInput(f"{source}: key {quoted(key)}{f' of {field}' if field else ''}: {REMEDY}")
            waiting.append((f"{field}.{key}" if field else str(key), child))


def _is_half(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return True
    return False
