"""The paper's policy as a mind asks it: bearings are worked out only as far as the body asks for them.

That is between this policy and the project's own bodies, which read bearings in the tick in which they were made, and
nothing but one after the other. Whoever wraps or extends `PotentialField` gets plain tuples.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, overload

from agent.policies.potential_field.policy import PotentialField
from agent.policies.potential_field.pull.direction import bearings_by_force
from agent.view import View

if TYPE_CHECKING:
    from agent.policies.potential_field.pull.field import Pull


class Ranking(Sequence[float]):
    """Bearings, best first, of which the first few are known and all others are worked out when somebody asks for them.

    To be read in the tick in which it was made, because only then the others can be worked out.
    """

    def __init__(self, first: Sequence[float], whole: Callable[[], Sequence[float]]) -> None:
        """Work out nothing yet.

        Args:
            first: The best bearings, at least one, rad.
            whole: Works out all of them, beginning with these; called once at most.
        """
        self._known = tuple(first)
        self._whole: Callable[[], Sequence[float]] | None = whole

    def __iter__(self) -> Iterator[float]:
        at = 0
        while at < len(self._known) or at < len(self._all()):
            yield self._known[at]
            at += 1

    def __bool__(self) -> bool:
        return bool(self._known)

    def __len__(self) -> int:
        return len(self._all())

    def __contains__(self, bearing: object) -> bool:
        return bearing is not None and (bearing in self._known or bearing in self._all())

    @overload
    def __getitem__(self, at: int) -> float: ...
    @overload
    def __getitem__(self, at: slice) -> tuple[float, ...]: ...
    def __getitem__(self, at: int | slice) -> float | tuple[float, ...]:
        return self._known[at] if isinstance(at, int) and 0 <= at < len(self._known) else self._all()[at]

    def _all(self) -> tuple[float, ...]:
        if self._whole is not None:
            self._known, self._whole = tuple(self._whole()), None
        return self._known


class LazyPotentialField(PotentialField):
    """One robot's social potential field, with a `Ranking` in place of a tuple where forces were left out."""

    def _ranked(self, view: View, start: tuple[int, int]) -> tuple[Pull, Sequence[float]]:
        pull = self._pull(view, start, lead=True)
        if pull.sure is None:
            return pull, self._bearings(pull)
        best = bearings_by_force(pull.sums)[: pull.sure]
        return pull, Ranking(best, lambda: self._bearings(self._pull(view, start)))
