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
    """The connection of the world with its robots.

    Attributes:
        keys: The fleet's keys.
        names: The robots' names by number.
        posts: Sends to a robot, by number.
        mailbox: Their answers.
        connected: Whether the router answers now.
        now: Seconds of a clock that never goes back.
        ending: Whether the world should end.
        has_ended: Asks the launcher whether a robot's process has ended, by number; None where there is no launcher.
    """

    keys: FleetKeys
    names: Mapping[int, str]
    posts: Mapping[int, Callable[[bytes], None]]
    mailbox: AnswersMailbox[ToWorld | Presence]
    connected: Callable[[], bool]
    now: Callable[[], float]
    ending: Callable[[], bool]
    has_ended: Callable[[int], bool] | None = None
