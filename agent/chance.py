"""The chance of a fleet: all draws of its minds, from the fleet's key, or from the scenario's seed where there is none.

Every copy of the scenario holds the seed, and so tells in advance what is drawn from it. A draw from the key is a keyed
hash of the question: the robots, which hold the key, agree on it without a word, and for all others it is chance.

    fleet = Chance(seed=31, key=b"k" * 32)
    fleet.draw(Purpose.PLAN, 4)            0.41, in every robot of the fleet
    own = fleet.of_robot(2, incarnation=1)
    own(Purpose.POLICY, 10, 0)               0.94, which r2 draws in tick 10 for its question 0

The same key and seed give the same draws in every run, because robots share nothing else that differs from run to run.
So each run needs another seed, which may be public.

All minds of a process draw from one `Chance`. A new `key` in it replaces all their draws from then on.
"""

from __future__ import annotations

import struct
from functools import partial
from hashlib import blake2b
from typing import TYPE_CHECKING, Protocol

from patrol.random import draw

if TYPE_CHECKING:
    from patrol.random import Purpose

_DRAWS = b"fogwatch draws"
"""Keeps draws apart from the tags of positions, which are hashes with the same key."""

_MASK = (1 << 64) - 1


class Draw(Protocol):
    """A source of random numbers in [0, 1); the same question always has the same answer."""

    def __call__(self, purpose: Purpose, *question: int) -> float:
        """Draw for a purpose and a question of integers, such as a tick."""
        ...


class Chance:
    """The source of all draws of a fleet's minds."""

    __slots__ = ("key", "seed")

    def __init__(self, seed: int, key: bytes | None = None) -> None:
        self.seed = seed
        self.key = key  # 1 to 64 bytes, a fleet's or another secret; None to draw from the seed alone

    def draw(self, purpose: Purpose, *question: int) -> float:
        """Draw a number that is the same for all robots of the fleet, uniform over the multiples of 2^-53 in [0, 1).

        Integers of the question are taken modulo 2^64.
        """
        if self.key is None:
            return draw(self.seed, purpose, *question)
        values = [value & _MASK for value in (self.seed, purpose, *question)]
        packed = struct.pack(f"<{len(values)}Q", *values)
        digest = blake2b(packed, digest_size=8, key=self.key, person=_DRAWS).digest()
        return (int.from_bytes(digest, "little") >> 11) * 2.0**-53

    def of_robot(self, number: int, incarnation: int) -> Draw:
        """Return one robot's own draws, others in each incarnation of its process."""
        return partial(self._own_draw, number, incarnation)

    def _own_draw(self, number: int, incarnation: int, purpose: Purpose, *question: int) -> float:
        return self.draw(purpose, number, incarnation, *question)
