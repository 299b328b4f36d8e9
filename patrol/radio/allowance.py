"""One robot's allowance where the fleet's radio has a budget: it earns bits tick by tick, and each frame takes some.

A robot begins with nothing. So by any tick it has sent no more than its share of the time until then, and no process
that takes its place can make it more.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

BITS = 8
"""Bits in a byte."""

_ROUNDING = 1e-6


@dataclass(frozen=True, slots=True)
class Share:
    """A robot's share of the fleet's budget.

    Attributes:
        per_tick: Bits earned in a tick.
        most: Bits that can be saved up, enough for the longest frame.
        overhead: Bytes that the radio adds to a frame.
        frame: Bytes of the longest frame.
    """

    per_tick: float
    most: float
    overhead: int
    frame: int

    def cost(self, length: int) -> int:
        """Return the bits on the air.

        Args:
            length: Bytes of a frame.
        """
        return BITS * (length + self.overhead)

    @property
    def earns_frame_in(self) -> int:
        """Ticks in which a robot that has nothing earns the longest frame."""
        return math.ceil(self.cost(self.frame) / self.per_tick - 1e-9)

    @property
    def earns_most_in(self) -> int:
        """Ticks in which a robot that has nothing earns as much as it can save."""
        return math.ceil(self.most / self.per_tick - 1e-9)


class Allowance:
    """The bits of its share that a robot has earned and not used."""

    def __init__(self, share: Share) -> None:
        """Begin with nothing.

        Args:
            share: The robot's.
        """
        self._share = share
        self._bits = 0.0
        self._k: int | None = None

    def earn(self, k: int) -> None:
        """Earn until a tick; ticks that were left out, such as those of a pause, count as well.

        Args:
            k: The tick, larger each time.
        """
        ticks = 0 if self._k is None else k - self._k
        self._bits = min(self._bits + ticks * self._share.per_tick, self._share.most)
        self._k = k

    def suffices(self, lengths: Iterable[int]) -> bool:
        """Return True if all of some frames may be sent, or there is no use in waiting.

        Args:
            lengths: Their bytes.
        """
        return self._bits + _ROUNDING >= min(sum(map(self._share.cost, lengths)), self._share.most)

    def take(self, length: int) -> bool:
        """Use bits for a frame.

        Args:
            length: Its bytes.

        Returns:
            Whether it may be sent; otherwise nothing is used.
        """
        cost = self._share.cost(length)
        if length > self._share.frame or cost > self._bits + _ROUNDING:
            return False
        self._bits -= cost
        return True
