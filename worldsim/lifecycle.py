"""The life of a robot's process: what faults do to it between ticks, and what a journal says of that."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from patrol.journal import Status

if TYPE_CHECKING:
    from worldsim.timeline import Timeline

SKIPPED = "skipped"
WAITING = "waiting"
LOOKED_AT = "looked at"
"""Kinds of events that change no status; the last tells what was seen of a process when its pause began or ended."""

APPLIES: Mapping[str, frozenset[Status]] = {
    "kill": frozenset({Status.ALIVE, Status.PAUSED}),
    "restart": frozenset({Status.ALIVE, Status.PAUSED, Status.DEAD, Status.LOST}),
    "pause": frozenset({Status.ALIVE}),
    "resume": frozenset({Status.PAUSED}),
    "join": frozenset({Status.ABSENT, Status.LEFT}),
    "leave": frozenset({Status.ALIVE, Status.PAUSED}),
}
"""The robots that each kind of act makes sense for, by their status; none that is just being started."""

BECOMES: Mapping[str, Status] = {
    "kill": Status.DEAD,
    "restart": Status.ALIVE,
    "pause": Status.PAUSED,
    "resume": Status.ALIVE,
    "join": Status.ALIVE,
    "leave": Status.LEFT,
}
"""What each kind of act makes of them, once it is done."""

STOPPED = "its process stands still"
UNSEEN = "its process cannot be looked at here"
"""What was seen of a process that was to be stopped; anything else is wrong."""


def standing_at_the_end(timeline: Timeline, numbers: Iterable[int], ticks: int) -> dict[int, Status]:
    """Each robot's status after so many ticks if its process does nothing else than what it is told to."""
    standing = {number: Status.ABSENT if number in timeline.starts_absent else Status.ALIVE for number in numbers}
    for k in range(ticks):
        for act in timeline.acts(k):
            if standing[act.number] in APPLIES[act.kind]:
                standing[act.number] = BECOMES[act.kind]
    return standing


def process_name(robot: str, incarnation: int) -> str:
    """What a robot's process is called where exit codes are listed: the first like the robot, the next "r1 (2)"."""
    return robot if incarnation <= 1 else f"{robot} ({incarnation})"
