"""What a mind is put into: a robot to read and command, a radio to send and hear with.

`agent.process` knows only these two protocols. `agent.robots.sim` implements both for a robot of the world simulator,
`agent.radios.direct` the radio for robots that hear each other without a world in between.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from agent.decision import Decision
from patrol.pose import Pose


@dataclass(frozen=True, slots=True)
class Sensed:
    """What a robot senses at the beginning of tick k.

    pose: its own. bumped: its last move was cancelled. contacts: intruders in its view, x and y in m. clock_s: what its
    own clock shows, s.
    """

    k: int
    pose: Pose
    bumped: bool
    contacts: tuple[tuple[float, float], ...] = ()
    clock_s: float = 0.0


class Robot(Protocol):
    """A body that can be read and commanded."""

    def sense(self) -> Sensed | None:
        """Wait for the next tick; None when it is time to leave.

        A robot whose pose stays away for long stops meanwhile: who does not know where it is must not drive.
        """
        ...

    def act(self, decision: Decision, decision_ms: float) -> None:
        """Obey for one step. decision_ms: wall time that the decision took."""
        ...


class Radio(Protocol):
    """A broadcast of position frames."""

    def send(self, frames: tuple[bytes, ...]) -> None:
        """Send this robot's position and its contacts."""
        ...

    def hear(self) -> list[bytes] | None:
        """The frames that have arrived for this tick's decision, by sender and sequence.

        None when the tick is over, so that a decision would come too late, or when it is time to leave.
        """
        ...
