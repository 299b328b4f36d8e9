"""The share of positions that are lost: where it is large, robots believe different things."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection

    from agent.view import View

LOSSY = 0.05
"""Share of positions that are lost, over about `MEMORY_S`, from which on robots cannot rely on believing the same. They
can again once half as many are."""

MEMORY_S = 300.0
"""Time over which losses are averaged, s."""


class Loss:
    """Notices whether many positions of others are lost. Those that were never sent count as lost."""

    def __init__(self, step: float) -> None:
        self.is_lossy = False
        self._share = 0.0
        self._weight = step / MEMORY_S

    def note(self, view: View, others: Collection[int]) -> None:
        """Take note of which of some robots, all among `View.peers`, were heard in a tick."""
        lost = sum(view.peers[number].tick < view.tick for number in others) / max(len(others), 1)
        self._share += (lost - self._share) * self._weight
        self.is_lossy = self._share > (0.5 * LOSSY if self.is_lossy else LOSSY)
