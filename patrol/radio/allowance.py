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
    """A robot's share of the fleet's budget."""

    per_tick: float  # bits earned in a tick
    most: float  # bits that can be saved up, enough for the longest frame
    overhead: int  # bytes that the radio adds to a frame
    frame: int  # bytes of the longest frame

    def cost(self, length: int) -> int:
        """Return the bits on the air of a frame of `length` bytes.

        For example, 28 bytes with an overhead of 12 cost 320 bits.
        """
        return BITS * (length + self.overhead)

    @property
    def earns_frame_in(self) -> int:
        """Ticks in which a robot that has nothing earns the longest frame."""
        # Less a little, so that a quotient that is whole but for rounding does not count as one tick more.
        return math.ceil(self.cost(self.frame) / self.per_tick - 1e-9)

    @property
    def earns_most_in(self) -> int:
        """Ticks in which a robot that has nothing earns as much as it can save."""
        return math.ceil(self.most / self.per_tick - 1e-9)


class Allowance:
    """The bits of its share that a robot has earned and not used."""

    def __init__(self, share: Share) -> None:
        """Begin with nothing."""
        self._share = share
        self._bits = 0.0
        self._k: int | None = None

    def earn(self, k: int) -> None:
        """Earn until tick `k`, which grows each time; ticks left out, such as those of a pause, count as well.

        For example, at 100 bits per tick, calls with ticks 3 and 7 earn 400 bits: the first one only sets the clock.
        """
        ticks = 0 if self._k is None else k - self._k
        self._bits = min(self._bits + ticks * self._share.per_tick, self._share.most)
        self._k = k

    def suffices(self, lengths: Iterable[int]) -> bool:
        """Return True if frames of these lengths, in bytes, may all be sent, or there is no use in waiting."""
        # More than can be saved up is never reached: then waiting would be of no use.
        return self._bits + _ROUNDING >= min(sum(map(self._share.cost, lengths)), self._share.most)

    def take(self, length: int) -> bool:
        """Use bits for a frame of `length` bytes; return False, and use none, where it may not be sent."""
        cost = self._share.cost(length)
        # Sums of shares carry rounding, which must not hold a frame back for a tick.
        if length > self._share.frame or cost > self._bits + _ROUNDING:
            return False
        self._bits -= cost
        return True
