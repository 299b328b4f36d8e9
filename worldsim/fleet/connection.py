"""What connects a world with its robots, and what identifies its run to them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from patrol.net.keys import FleetKeys
from patrol.net.mailbox import Presence
from patrol.net.messages.phases import PROTOCOL, HelloReply, ToWorld
from patrol.net.security.tick_chain import TickChain
from worldsim.mailbox import AnswersMailbox


@dataclass(frozen=True, slots=True)
class FleetConnection:
    """What connects the world with its robots.

    Attributes:
        keys: The fleet's keys.
        names: The robots' names by number.
        posts: What sends to each robot, by number.
        mailbox: Where their answers arrive.
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


@dataclass(frozen=True, slots=True)
class RunIdentity:
    """What identifies a run to its robots.

    Attributes:
        number: Random number of the run.
        scenario: The scenario's hash.
        chain: Proves which ticks have begun.
        seat: Gives the instance of the process that the launcher starts for a robot, by number and incarnation; None
            where there is no launcher.
    """

    number: int
    scenario: str
    chain: TickChain
    seat: Callable[[int, int], int] | None = None

    def unlike(self, message: HelloReply) -> str:
        """What of a process is not as in this run, and the remedy; empty when all is.

        Args:
            message: From the process.
        """
        if message.protocol != PROTOCOL:
            versions = f"{message.protocol}, the world's is {PROTOCOL}"
            return f"protocol ({versions}); run the same version of fogwatch on all hosts"
        if message.scenario != self.scenario:
            hashes = f"hash {message.scenario[:12]}, the world's is {self.scenario[:12]}"
            return f"scenario ({hashes}); give all processes the same file"
        return ""


@dataclass(frozen=True, slots=True)
class Addressee:
    """The process that a message is for, and what proves its tick.

    Attributes:
        incarnation: Of the process.
        instance: Of the process.
        run: Random number of the run.
        proof: Gives the proof that so many ticks have begun.
    """

    incarnation: int
    instance: int
    run: int
    proof: Callable[[int], bytes]
