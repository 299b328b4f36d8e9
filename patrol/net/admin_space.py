"""What routers say of themselves in Zenoh's admin space, as far as they can be read."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

ROUTERS = "@/*/router"
"""Where each router that can be reached says its version and its sessions."""
LONGEST = 1 << 18
"""Bytes of the longest answer: of a router with some hundred sessions."""
MOST = 16
"""Routers of which answers are read."""


@dataclass(frozen=True, slots=True)
class RouterFacts:
    """A router, as it describes itself.

    Attributes:
        version: Of Zenoh, without the build; empty where it says none.
        sessions: Number of processes and routers that are connected to it.
    """

    version: str
    sessions: int


def read_facts(answers: Iterable[bytes]) -> Iterator[RouterFacts]:
    """Read answers to a query of `ROUTERS`; what is none is left out."""
    for answer in answers:
        try:
            says = json.loads(answer)
        except (ValueError, RecursionError):
            continue
        version, sessions = (says.get(name) for name in ("version", "sessions")) if isinstance(says, dict) else ("", 0)
        if isinstance(version, str) and isinstance(sessions, list):
            yield RouterFacts(version.partition("-")[0].removeprefix("v")[:20], len(sessions))
