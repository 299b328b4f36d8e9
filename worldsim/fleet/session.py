"""One session of the world with a robot's process."""

from __future__ import annotations

from dataclasses import dataclass

from patrol.net.messages.phases import ToWorld
from patrol.net.security.transcripts import WorldTranscript
from worldsim.fleet.connection import Addressee


@dataclass(frozen=True, slots=True)
class Session:
    """The process that speaks for a robot, and what was exchanged with it."""

    process: Addressee
    transcript: WorldTranscript

    def speaks(self, message: ToWorld) -> bool:
        """Whether a message is of this process and its run."""
        to = self.process
        return (message.instance, message.incarnation, message.run) == (to.instance, to.incarnation, to.run)
