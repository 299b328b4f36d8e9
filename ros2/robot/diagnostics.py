"""The topic of ROS for how a robot's parts do: patrol, localisation, driving and radio, once a second.

A thread of its own sends, so that the robot's tools also see a mind that hangs.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
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
"""How long a lost tick is warned of, s."""
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


@dataclass(frozen=True, slots=True)
class DecisionReading:
    """The last decision."""

    age_s: float  # in our time
    tick: int
    state: str
    mfow_s: float  # as the robot believes it
    decision_ms: float  # wall time
    frames_refused: int
    peers_s: Mapping[str, float]  # ages of the other robots' last positions, by name


@dataclass(frozen=True, slots=True)
class Reading:
    """The state of a robot at one time."""

    decision: DecisionReading | None  # the last one; None before the first
    missed: int = 0  # ticks without a decision so far
    missed_lately: bool = False  # one of these was in the last `MISSED_S`
    unlocated: str = ""  # why the pose is unknown; empty if it is known
    odometry_s: float | None = None  # age of the newest odometry; None before the first
    correction_s: float | None = None  # age of what corrects the odometry; None while unknown
    # numbers of messages of the robot that could not be used, by reason
    refused: Mapping[str, float] = field(default_factory=dict)
    stopped: str = ""  # why the robot may not drive; empty if it may


def statuses(facts: Patrolling, reading: Reading) -> tuple[DiagnosticStatus, ...]:
    """Judge a robot by one status each of patrol, localisation, driving and radio."""
    parts = {
        "patrol": _patrol(facts, reading),
        "localisation": _localisation(reading),
        "driving": (DiagnosticLevel.WARN, reading.stopped, {})
        if reading.stopped
        else (DiagnosticLevel.OK, "may drive", {}),
        "radio": _radio(facts, reading),
    }
    return tuple(
        DiagnosticStatus(level, f"fogwatch {facts.robot}: {part}", message, facts.robot, tuple(values.items()))
        for part, (level, message, values) in parts.items()
    )


_Part = tuple[DiagnosticLevel, str, dict[str, str]]


def _patrol(facts: Patrolling, reading: Reading) -> _Part:
    last = reading.decision
    if last is None:
        return DiagnosticLevel.WARN, "no decision yet", {}
    values = {
        "tick": str(last.tick),
        "ticks lost": str(reading.missed),
        "MFoW believed, s": f"{last.mfow_s:.1f}",
        "last decision, ms": f"{last.decision_ms:.1f}",
        "age of the last decision, s": f"{last.age_s:.1f}",
    }
    if last.age_s * facts.factor > LATE_TICKS * facts.step_s:
        return DiagnosticLevel.ERROR, f"no decision for {last.age_s:.1f} s", values
    if reading.missed_lately:
        return DiagnosticLevel.WARN, f"{last.state}; ticks were lost", values
    return DiagnosticLevel.OK, last.state, values


def _localisation(reading: Reading) -> _Part:
    values = {
        "age of the odometry, s": _age(reading.odometry_s),
        "age of the correction, s": _age(reading.correction_s),
        **{f"messages refused: {reason}": f"{count:.0f}" for reason, count in reading.refused.items()},
    }
    if reading.unlocated:
        return DiagnosticLevel.ERROR, reading.unlocated, values
    return DiagnosticLevel.OK, "the pose is known", values


def _radio(facts: Patrolling, reading: Reading) -> _Part:
    last = reading.decision
    others = len(facts.names) - 1
    heard = {} if last is None else {name: age for name, age in last.peers_s.items() if age <= facts.forget_after_s}
    ages = {} if last is None else dict(list(last.peers_s.items())[:MOST_PEERS])
    values = {
        "frames refused": "0" if last is None else str(last.frames_refused),
        **{f"age of the position of {name}, s": _age(age) for name, age in ages.items()},
    }
    level = DiagnosticLevel.WARN if others and not heard else DiagnosticLevel.OK
    return level, f"hears {len(heard)} of {others} other robots", values


def _age(seconds: float | None) -> str:
    return "unknown" if seconds is None else f"{seconds:.1f}"


class Diagnostics:
    """Publishes how a robot does (`agent.ports.Telemetry`)."""

    def __init__(
        self,
        hardware: Hardware,
        facts: Patrolling,
        peers: Mapping[int, Peer],
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        """Make the publisher; `peers` goes on to change between two reports."""
        self._hardware, self._facts, self._peers, self._now = hardware, facts, peers, now
        topic = hardware.settings.topic("diagnostics")
        self._messages = hardware.link.publisher(topic, DiagnosticArray)
        self._last: tuple[float, DecisionReading] | None = None
        self._missed, self._missed_at = 0, -MISSED_S
        self._over = Event()

    def report(self, sensed: Sensed, decision: Decision, decision_ms: float) -> None:
        """A decision has been taken."""
        now_s, facts = self._now(), self._facts
        if self._last is not None and (lost := sensed.k - self._last[1].tick - 1) > 0:
            self._missed, self._missed_at = self._missed + lost, now_s
        peers_s = {
            facts.names[number]: (sensed.k - peer.tick) * facts.step_s
            for number, peer in self._peers.items()
            if number in facts.names
        }
        reading = DecisionReading(
            0.0,
            sensed.k,
            str(decision.state),
            decision.mfow * facts.step_s,
            decision_ms,
            decision.rejected,
            peers_s,
        )
        self._last = now_s, reading

    def watch(self, stopped: Callable[[], str]) -> None:
        """Begin to publish, once a second; `stopped` returns why the robot may not drive, empty if it may."""
        Thread(target=self._publish, args=(stopped,), name="diagnostics", daemon=True).start()

    def close(self) -> None:
        """Publish no more."""
        self._over.set()

    def _publish(self, stopped: Callable[[], str]) -> None:
        while not self._over.is_set():
            reading = self.read(stopped())
            self._messages.send(DiagnosticArray(self._hardware.stamp_ns(), statuses(self._facts, reading)))
            self._over.wait(EVERY_S)

    def read(self, stopped: str) -> Reading:
        """Return the state of the robot now; called from any thread.

        `stopped` is the reason why it may not drive, empty if it may.
        """
        now_s, last, hardware = self._now(), self._last, self._hardware
        return Reading(
            decision=None if last is None else replace(last[1], age_s=now_s - last[0]),
            missed=self._missed,
            missed_lately=now_s - self._missed_at < MISSED_S,
            unlocated=hardware.why,
            odometry_s=hardware.odometry_age_s,
            correction_s=hardware.correction_age_s,
            refused=hardware.refused,
            stopped=stopped,
        )
