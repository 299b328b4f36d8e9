"""The connection of a world with its robots."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from patrol.net.keys import FleetKeys
from patrol.net.mailbox import Presence
from patrol.net.messages.phases import ToWorld
from worldsim.mailbox import AnswersMailbox


@dataclass(frozen=True, slots=True)
class FleetConnection:
    """The connection of the world with its robots."""

    keys: FleetKeys
    names: Mapping[int, str]
    posts: Mapping[int, Callable[[bytes], None]]  # by number; each sends to a robot
    mailbox: AnswersMailbox[ToWorld | Presence]
    connected: Callable[[], bool]  # True if the router answers now
    now: Callable[[], float]  # seconds of a clock that never goes back
    ending: Callable[[], bool]  # True if the world should end
    has_ended: Callable[[int], bool] | None = None  # asks the launcher about a robot's process; None without a launcher
