"""Draws of many shapes for one thing, from a hash that counts them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from patrol.random import draw

T = TypeVar("T")


class Dice:
    """A row of draws for one thing: for example the faults that begin in one interval."""

    def __init__(self, *what: int) -> None:
        """what: the arguments of `patrol.random.draw` but for the last, which counts the draws."""
        self._what = what
        self._thrown = 0

    def share(self) -> float:
        """A float in [0, 1)."""
        self._thrown += 1
        return draw(*self._what, self._thrown)

    def between(self, least: float, most: float) -> float:
        """A float, to three significant digits."""
        return float(f"{least + (most - least) * self.share():.3g}")

    def whole(self, least: int, most: int) -> int:
        """An integer, both bounds included."""
        return least + int((most - least + 1) * self.share())

    def choice(self, *what: T) -> T:
        """One of several."""
        return what[self.whole(0, len(what) - 1)]

    def shuffled(self, what: Sequence[T]) -> list[T]:
        """All of them, in any order."""
        return [what[place] for _, place in sorted((self.share(), place) for place in range(len(what)))]

    def some(self, names: Sequence[str], most: int) -> list[str]:
        """One to `most` of the names, sorted."""
        return sorted(self.shuffled(names)[: self.whole(1, most)])
