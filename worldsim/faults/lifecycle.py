"""The life of a robot's process: what faults do to it between ticks, and what a journal says of that."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from patrol.journal import Status

if TYPE_CHECKING:
    from worldsim.faults.timeline import Timeline

SKIPPED = "skipped"
WAITING = "waiting"
LOOKED_AT = "looked at"
"""Kinds of events that change no status; the last reports what was seen of a process when its pause began or ended."""

APPLIES: Mapping[str, frozenset[Status]] = {
    "kill": frozenset({Status.ALIVE, Status.PAUSED}),
    "restart": frozenset({Status.ALIVE, Status.PAUSED, Status.DEAD, Status.LOST}),
    "pause": frozenset({Status.ALIVE}),
    "resume": frozenset({Status.PAUSED}),
    "join": frozenset({Status.ABSENT, Status.LEFT}),
    "leave": frozenset({Status.ALIVE, Status.PAUSED}),
}
"""The statuses of the robots that each kind of act makes sense for; it makes none for one that is being started."""

BECOMES: Mapping[str, Status] = {
    "kill": Status.DEAD,
    "restart": Status.ALIVE,
    "pause": Status.PAUSED,
    "resume": Status.ALIVE,
    "join": Status.ALIVE,
    "leave": Status.LEFT,
}
"""The status that each kind of act gives a robot, once it is done."""

AS_IT_IS: Mapping[Status, str] = {status: status.name.lower() for status in Status} | {
    Status.LEFT: "gone",
    Status.ABSENT: "not there yet",
}
BEING_STARTED = "being started"
"""The words, in events of kind `SKIPPED`, for the status of a robot that an act makes no sense for."""

STOPPED = "its process stands still"
UNSEEN = "its process cannot be looked at here"
"""The journal's words for a process that should be stopped; all others are errors."""


def standing_at_the_end(timeline: Timeline, numbers: Iterable[int], ticks: int) -> dict[int, Status]:
    """Return the robots' statuses after a number of ticks, if their processes do only what faults make them do."""
    standing = {number: Status.ABSENT if number in timeline.starts_absent else Status.ALIVE for number in numbers}
    for k in range(ticks):
        for act in timeline.acts(k):
            if standing[act.number] in APPLIES[act.kind]:
                standing[act.number] = BECOMES[act.kind]
    return standing


def process_name(robot: str, incarnation: int) -> str:
    """Name a robot's process in lists of exit codes: ``r1`` for the first, ``r1 (2)`` for the second."""
    return robot if incarnation <= 1 else f"{robot} ({incarnation})"
