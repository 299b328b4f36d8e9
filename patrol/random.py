"""Randomness without a stream: every draw is a hash of its arguments.

A draw depends on its arguments alone, never on how many draws came before it, so the order in which robots, links or
processes ask cannot change a run. The hash is splitmix64 (Steele, Lea and Flood, "Fast splittable pseudorandom number
generators", OOPSLA 2014) chained over the arguments:

    h = 0;  for each value v:  h = finalise((h XOR v) + 0x9E3779B97F4A7C15)      (all modulo 2^64)

so that ``mix(s)`` is the first output of the reference generator seeded with ``s``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import IntEnum
from operator import index
from typing import SupportsIndex, TypeVar

__all__ = ["Draws", "Purpose", "draw"]

T = TypeVar("T")

_MASK = (1 << 64) - 1
_GOLDEN = 0x9E3779B97F4A7C15


class Purpose(IntEnum):
    """The purpose of a draw: the value after the seed, so that draws for different things never share arguments."""

    START = 1
    RANDOM_MOVE = 2
    ETHER = 3
    GIVE_WAY = 4
    FAULT = 5
    SPOOF = 6
    SENSES = 7
    NEMESIS = 8
    CHAOS = 9
    UNSTUCK = 10
    POLICY = 11
    STRANGER = 12
    ODOMETRY = 13
    RADIO = 14
    PLAN = 16
    MOTION = 17
    GROUND = 18
    TIES = 19
    INFILTRATION = 20


def mix(*values: SupportsIndex) -> int:
    """Mix values into a 64-bit integer.

    Args:
        values: One or more integers, any sign and size, taken modulo 2^64.

    Raises:
        TypeError: Without any value.
    """
    if not values:
        raise TypeError("mix needs at least one value")
    state = 0
    for value in values:
        state = _finalise_hash(((state ^ (index(value) & _MASK)) + _GOLDEN) & _MASK)
    return state


def draw(*values: SupportsIndex) -> float:
    """Draw a float in [0, 1), uniform over the multiples of 2^-53.

    For example, ``draw(seed, Purpose.POLICY, robot, tick)`` gives the same number whenever it is asked for.

    Args:
        values: One or more integers; by convention the first is the scenario's seed and the second a `Purpose`.
    """
    return (mix(*values) >> 11) * 2.0**-53


def gauss(*values: SupportsIndex) -> float:
    """Draw from the standard normal distribution (Box and Muller).

    Args:
        values: As in `draw`.
    """
    radius = math.sqrt(-2.0 * math.log(1.0 - draw(*values, 0)))
    return radius * math.cos(2.0 * math.pi * draw(*values, 1))


class Draws:
    """A sequence of draws for one thing, such as the faults that begin in one interval."""

    def __init__(self, *what: int) -> None:
        """Begin at the first draw.

        Args:
            what: The arguments of `draw` but for the last, which counts the draws.
        """
        self._what = what
        self._count = 0

    def share(self) -> float:
        """Draw a float in [0, 1)."""
        self._count += 1
        return draw(*self._what, self._count)

    def between(self, least: float, most: float) -> float:
        """Draw a float, to three significant digits.

        For example, ``between(0.3, 2.0)`` may give 1.27.

        Args:
            least: Lower bound.
            most: Upper bound.
        """
        return float(f"{least + (most - least) * self.share():.3g}")

    def whole(self, least: int, most: int) -> int:
        """Draw an integer.

        For example, ``whole(1, 6)`` is a throw of a die.

        Args:
            least: Lower bound, included.
            most: Upper bound, included.
        """
        return least + int((most - least + 1) * self.share())

    def choice(self, *what: T) -> T:
        """One of several values.

        Args:
            what: The values.
        """
        return what[self.whole(0, len(what) - 1)]

    def shuffled(self, what: Sequence[T]) -> list[T]:
        """Return all values in a drawn order.

        Args:
            what: The values.
        """
        return [what[index] for _, index in sorted((self.share(), index) for index in range(len(what)))]

    def some(self, names: Sequence[str], most: int) -> list[str]:
        """Draw some of the names, sorted.

        Args:
            names: To choose from.
            most: How many at most; at least one is chosen.
        """
        return sorted(self.shuffled(names)[: self.whole(1, most)])


def _finalise_hash(z: int) -> int:
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
    return z ^ (z >> 31)
