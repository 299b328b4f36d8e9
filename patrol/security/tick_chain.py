"""A hash chain by which a robot knows that a tick has begun (Lamport, Password authentication, CACM 24(11), 1981).

The world draws a secret and hashes it over and over. It gives the last hash away when it greets a robot, and with each
tick the hash before. From one proof, all later ones can be checked by hashing them, but none can be made: so no
listener can send a robot a tick that the world has not begun. A gap, after a pause or an outage, only takes as many
more hashes.
"""

from __future__ import annotations

import hashlib

PROOF = 16
"""Bytes of a proof."""
LONGEST = 1 << 18
"""Links of the longest chain, 0.2 s to make; in a longer run several ticks share one."""
CHEAP = 256
"""Hashes that a robot makes for any message. It makes more for one message in `COSTLY_S` only, so that forged ones
cannot keep it busy."""
COSTLY_S = 1.0


class TickChain:
    """The world's side: has the proofs of all ticks of a run.

    Each link of the chain proves `stride` ticks.
    """

    def __init__(self, secret: bytes, ticks: int) -> None:
        """Make the chain for a number of ticks, from random bytes that no other process has."""
        self.stride = stride_of(ticks)
        links = ticks // self.stride + 2
        self._links = bytearray(PROOF * links)
        link = secret
        for index in range(links - 1, -1, -1):
            link = _before(link)
            self._links[PROOF * index : PROOF * (index + 1)] = link

    def proof(self, begun: int) -> bytes:
        """Return the proof that so many ticks have begun."""
        index = begun // self.stride
        return bytes(self._links[PROOF * index : PROOF * (index + 1)])


class TickProofs:
    """A robot's side: checks proofs against the newest that it has found right."""

    def __init__(self, begun: int, proof: bytes, stride: int, now: float) -> None:
        """Begin with a proof that is believed, by which `begun` ticks have begun; `now` is in s."""
        self._stride = stride
        self._place = begun // stride
        self._proof = proof
        self._costly_at = now

    def accepts(self, begun: int, proof: bytes, now: float) -> bool:
        """Return whether a proof shows that so many ticks have begun; `now` is in s."""
        index = begun // self._stride
        hashes = index - self._place
        if abs(hashes) > LONGEST or not self._affords(abs(hashes), now):
            return False
        if hashes < 0:
            return _hashed(self._proof, -hashes) == proof
        if _hashed(proof, hashes) != self._proof:
            return False
        self._place, self._proof = index, proof
        return True

    def _affords(self, hashes: int, now: float) -> bool:
        if hashes <= CHEAP:
            return True
        if now < self._costly_at:
            return False
        self._costly_at = now + COSTLY_S
        return True


def stride_of(ticks: int) -> int:
    """Return the number of ticks that share one link of a run's chain."""
    return ticks // LONGEST + 1


def _hashed(link: bytes, times: int) -> bytes:
    for _ in range(times):
        link = _before(link)
    return link


def _before(link: bytes) -> bytes:
    return hashlib.blake2b(link, digest_size=PROOF).digest()
