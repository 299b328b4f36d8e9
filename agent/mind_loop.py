"""The loop around a mind: sense, send, hear, decide and act, tick after tick, and report to viewers."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from agent.answers import policy_failure
from agent.ports import PolicyFailed, Telemetry
from patrol.errors import printable
from runtime.messages.telemetry import MAX_TEXT, Traffic, pack_view
from runtime.messages.telemetry import Telemetry as TelemetryView
from runtime.process.deadline import Late, deadline
from runtime.reporting.logs import Log
from runtime.reporting.vitals import DECIDING, DECISION, MFOW, PEERS, REFUSED

if TYPE_CHECKING:
    from agent.mind import Mind
    from agent.ports import Decision, Radio, Robot
    from patrol.exchange import Sensed
    from runtime.reporting.vitals import Figure, Value, Vitals

TELEMETRY_S = 0.2
"""Wall time between two reports to viewers, s."""


def run_mind(mind: Mind, robot: Robot, radio: Radio, telemetry: Telemetry) -> str | None:
    """Sense, send, hear, decide and act until it is time to leave.

    Returns None then. If the policy fails, the robot is stopped, and the reason is returned.
    """
    while (sensed := robot.sense()) is not None:
        sensed = mind.locate(sensed)
        radio.send(mind.frames(sensed))
        frames = radio.hear()
        if frames is None:
            continue
        began = time.perf_counter()
        try:
            with deadline(mind.facts.limit_s):
                decision = mind.step(sensed, frames)
        except (PolicyFailed, Late) as failed:
            if failed.__cause__ is not None:
                Log(mind.spec.name).failure(failed.__cause__)
            reason = policy_failure(sensed.k, failed)
            robot.stop(reason)
            return reason
        decision_ms = (time.perf_counter() - began) * 1000.0
        telemetry.report(sensed, decision, decision_ms)
        robot.act(decision.command)
    return None


class Both:
    """Telemetry that reports to two receivers."""

    def __init__(self, first: Telemetry, second: Telemetry) -> None:
        self._both = first, second

    def report(self, sensed: Sensed, decision: Decision, decision_ms: float) -> None:
        """Report to the first, then to the second."""
        for telemetry in self._both:
            telemetry.report(sensed, decision, decision_ms)


class TickFigures:
    """Telemetry that leaves a mind's figures for followers of its process, and a line in the log of each tick."""

    def __init__(self, mind: Mind, vitals: Vitals, log: Log) -> None:
        """Begin with no tick."""
        self._mind = mind
        self._vitals = vitals
        self._log = log
        self._deciding_s = 0.0

    def report(self, sensed: Sensed, decision: Decision, decision_ms: float) -> None:
        """Leave the figures of a decision."""
        facts, belief = self._mind.facts, self._mind.belief
        peers = sum(sensed.k - peer.tick <= facts.patience for peer in belief.peers.values())
        refused = {str(reason): count for reason, count in belief.refused.items()}
        self._deciding_s += decision_ms / 1000.0
        figures: dict[Figure, Value] = {
            PEERS: peers,
            REFUSED: refused,
            DECISION: decision_ms / 1000.0,
            DECIDING: self._deciding_s,
            MFOW: decision.mfow * facts.step,
        }
        self._vitals.beat(sensed.k, figures)
        self._log.debug(f"tick {sensed.k}: {decision.state}, peers heard: {peers}, decided in {decision_ms:.1f} ms")


class TelemetrySender:
    """Shows decisions to viewers, at most one every `TELEMETRY_S`.

    `traffic` is called with True for the last report; it returns what the radio has carried, or None if that is not
    counted.
    """

    def __init__(self, post: Callable[[bytes], None]) -> None:
        self.traffic: Callable[[bool], Traffic | None] = lambda _final: None
        self.stopped: Callable[[], str] = lambda: ""
        self._post = post
        self._due = 0.0
        self._last: TelemetryView | None = None

    def report(self, sensed: Sensed, decision: Decision, decision_ms: float) -> None:
        """Show a decision if the last report is old enough."""
        now, charge = time.monotonic(), sensed.charge
        self._last = view = TelemetryView(
            k=sensed.k,
            state=str(decision.state),
            goal=decision.goal,
            refined=decision.refined,
            direction=decision.direction,
            mfow=decision.mfow,
            decision_ms=decision_ms,
            rejected=decision.rejected,
            # A robot of one's own may tell NaN, more than 1, or no text: viewers would drop its reports.
            stopped=printable(stopped)[:MAX_TEXT] if isinstance(stopped := self.stopped(), str) else "",
            charge=None if charge is None or math.isnan(charge) else float(min(max(charge, 0.0), 1.0)),
        )
        if now >= self._due:
            self._due = now + TELEMETRY_S
            self._post(pack_view(replace(view, traffic=self.traffic(False))))

    def close(self) -> None:
        """Show the last decision once more, with everything that the radio has carried."""
        if self._last is not None and (traffic := self.traffic(True)) is not None:
            self._post(pack_view(replace(self._last, traffic=traffic)))
