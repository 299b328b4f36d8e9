"""The tour as a value, without the search for it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Tour:
    """A closed tour, straight from each corner to the next, and from the last to the first."""

    length_m: float
    way: tuple[tuple[float, float], ...]  # corners in order, x and y in m
