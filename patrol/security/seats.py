"""Seats: proof that a launcher has started a robot's process, so that no other one can take its place.

A launcher gives each robot's process an instance that follows from the fleet's token, the robot and the incarnation. It
stands in the process's environment, where other users of the machine cannot read it. A process that reads it can take
that one seat, and learns nothing of the token. The world knows the token too and expects that instance. Without a
launcher a robot's process draws its instance, and the first to come takes the seat.
"""

from __future__ import annotations

import hmac
import os
from collections.abc import Mapping

SEAT = "FOGWATCH_SEAT"
"""The environment variable that holds a process's instance."""

_LARGEST = 2**63 - 1


def seat_of(token: str, fleet: str, robot: str, incarnation: int) -> int:
    """Return the instance of a process that a launcher starts, from 1 to 2^63 - 1."""
    text = f"fogwatch seat/{fleet}/{robot}/{incarnation}".encode()
    drawn = hmac.digest(token.encode("utf-8", "surrogatepass"), text, "sha256")[:8]
    return int.from_bytes(drawn, "big") >> 1 | 1


def own_instance(environment: Mapping[str, str]) -> int:
    """Return the instance of this process, from 1 to 2^63 - 1: its launcher's, or else a random one."""
    seat = environment.get(SEAT, "")
    if seat.isascii() and seat.isdigit() and len(seat) < 20 and 0 < int(seat) <= _LARGEST:
        return int(seat)
    return int.from_bytes(os.urandom(8), "big") >> 1 | 1
