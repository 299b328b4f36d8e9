"""Keeping the latest few results of something that takes long."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import TypeVar

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


def latest(results: dict[Key, Value], key: Key, make: Callable[[], Value], most: int) -> Value:
    """Return what is kept for a key, or make it; of what was asked for last, so many results are kept."""
    value = results.pop(key) if key in results else make()
    results[key] = value
    if len(results) > most:
        del results[next(iter(results))]
    return value
