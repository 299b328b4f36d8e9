"""The topic of ROS for how a robot's parts do: patrol, localisation, driving and radio, once a second.

A thread of its own sends, so that the robot's tools also see a mind that hangs.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import islice
from threading import Event, Thread

from agent.ports import Decision
from patrol.exchange import Sensed
from patrol.radio.peers import Peer
from ros2.robot.hardware import Hardware
from ros2.wire.messages import DiagnosticArray, DiagnosticLevel, DiagnosticStatus

EVERY_S = 1.0
"""Time between two messages, s."""
LATE_TICKS = 3
"""A mind that has decided nothing for so many ticks is late."""
MISSED_S = 10.0
"""Time for which a lost tick is warned of, s."""
MOST_PEERS = 32
"""Robots that are listed by name."""


@dataclass(frozen=True, slots=True)
class Patrolling:
    """The facts of a robot's patrol."""

    robot: str
    names: Mapping[int, str]  # of all robots of the fleet, by number
    step_s: float  # of a tick, in the robot's time
    factor: float  # seconds of the robot's time in one of ours
    forget_after_s: float  # silence after which a robot is forgotten


_Part = tuple[DiagnosticLevel, str, dict[str, str]]
"""The level of a part of the robot, a word for people, and values by name."""


@dataclass(frozen=True, slots=True)
class _Report:
    """A decision, when it came, and the ages of the other robots' last positions then, s, by name."""

    at_s: float
    tick: int
    decision: Decision
    decision_ms: float
    peers_s: Mapping[str, float]


class Diagnostics:
    """Publishes how a robot does (`agent.ports.Telemetry`)."""

    def __init__(
        self,
        hardware: Hardware,
        facts: Patrolling,
        peers: Mapping[int, Peer],
        no_tick: Callable[[], str] = lambda: "",
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        """Make the publisher; `peers` goes on to change between two reports. `no_tick` says why no tick comes."""
        self._no_tick = no_tick
        self._hardware, self._facts, self._peers, self._now = hardware, facts, peers, now
        topic = hardware.settings.topic("diagnostics")
        self._messages = hardware.link.publisher(topic, DiagnosticArray)
        self._last: _Report | None = None
        self._missed, self._missed_at_s = 0, -math.inf
        self._over = Event()

    def report(self, sensed: Sensed, decision: Decision, decision_ms: float) -> None:
        """A decision has been taken."""
        now_s, facts = self._now(), self._facts
        if self._last is not None and (missed := sensed.k - self._last.tick - 1) > 0:
            self._missed, self._missed_at_s = self._missed + missed, now_s
        peers_s = {
            facts.names[number]: (sensed.k - peer.tick) * facts.step_s
            for number, peer in self._peers.items()
            if number in facts.names
        }
        self._last = _Report(now_s, sensed.k, decision, decision_ms, peers_s)

    def watch(self, stopped: Callable[[], str]) -> None:
        """Begin to publish, once a second; `stopped` returns why the robot may not drive, empty if it may."""
        Thread(target=self._publish_diagnostics, args=(stopped,), name="diagnostics", daemon=True).start()

    def close(self) -> None:
        """Publish no more."""
        self._over.set()

    def _publish_diagnostics(self, stopped: Callable[[], str]) -> None:
        while not self._over.is_set():
            self._messages.send(DiagnosticArray(self._hardware.stamp_ns(), self.statuses(stopped())))
            self._over.wait(EVERY_S)

    def statuses(self, stopped: str) -> tuple[DiagnosticStatus, ...]:
        """Judge patrol, localisation, driving and radio by one status each; called from any thread.

        `stopped` is the reason why the robot may not drive, empty if it may.
        """
        last, robot = self._last, self._facts.robot
        parts: dict[str, _Part] = {
            "patrol": self._patrol_part(last),
            "localisation": self._localisation_part(),
            "driving": (DiagnosticLevel.WARN if stopped else DiagnosticLevel.OK, stopped or "may drive", {}),
            "radio": self._radio_part(last),
        }
        return tuple(
            DiagnosticStatus(level, f"fogwatch {robot}: {part}", message, robot, tuple(readings.items()))
            for part, (level, message, readings) in parts.items()
        )

    def _patrol_part(self, last: _Report | None) -> _Part:
        if last is None:
            return DiagnosticLevel.WARN, "no decision yet", {}
        now_s, facts = self._now(), self._facts
        age_s = now_s - last.at_s
        readings = {
            "tick": str(last.tick),
            "ticks lost": str(self._missed),
            "MFoW believed, s": f"{last.decision.mfow * facts.step_s:.1f}",
            "last decision, ms": f"{last.decision_ms:.1f}",
            "age of the last decision, s": f"{age_s:.1f}",
        }
        # The robot's time may run at another pace than ours, as in a simulation.
        if age_s * facts.factor > LATE_TICKS * facts.step_s:
            return DiagnosticLevel.ERROR, self._no_tick() or f"no decision for {age_s:.1f} s", readings
        if now_s - self._missed_at_s < MISSED_S:
            return DiagnosticLevel.WARN, f"{last.decision.state}; ticks were lost", readings
        return DiagnosticLevel.OK, str(last.decision.state), readings

    def _localisation_part(self) -> _Part:
        hardware = self._hardware
        readings = {
            "age of the odometry, s": _age_text(hardware.odometry_age_s),
            "age of the correction, s": _age_text(hardware.correction_age_s),
            **{f"messages refused: {reason}": f"{count:.0f}" for reason, count in hardware.refused.items()},
        }
        if why := hardware.why:
            return DiagnosticLevel.ERROR, why, readings
        return DiagnosticLevel.OK, "the pose is known", readings

    def _radio_part(self, last: _Report | None) -> _Part:
        ages = {} if last is None else last.peers_s
        count = len(self._facts.names) - 1
        heard_count = sum(age_s <= self._facts.forget_after_s for age_s in ages.values())
        readings = {
            "frames refused": "0" if last is None else str(last.decision.rejected),
            **{
                f"age of the position of {name}, s": _age_text(age_s)
                for name, age_s in islice(ages.items(), MOST_PEERS)
            },
        }
        # A robot that is alone in its fleet has nobody to hear.
        level = DiagnosticLevel.WARN if count and not heard_count else DiagnosticLevel.OK
        return level, f"hears {heard_count} of {count} other robots", readings


def _age_text(seconds: float | None) -> str:
    return "unknown" if seconds is None else f"{seconds:.1f}"
