"""The verdict's check of the radio's budget: what the robots have sent, counted from the journal's bytes."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from patrol.radio.message import longest_frame
from worldsim.verdict.common.check import Check

if TYPE_CHECKING:
    from patrol.journal.records import TickRecord
    from worldsim.verdict.common.check import JudgedRun, Readings

BITS = 8
WINDOW_S = 10.0
"""Over which the busiest stretch is measured, s."""

_ROUNDING = 1e-3
"""Bits."""


class WithinBudget(Check):
    """No robot has sent more than its share of `radio.budget`, and no frame was too long.

    A share is saved up for a second or a step, or until it holds the longest frame and a contact, whichever is more.
    The fleet begins with nothing saved, so at no time has it sent more than the budget times the time so far. Bits
    count as on the air, with the radio's overhead. Forged frames are not the robots', nor are copies that a fault made.
    """

    name = "budget"

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        scenario = run.prepared.scenario
        budget = scenario.radio.budget
        assert budget is not None
        self._budget = budget
        self._step = scenario.step
        self._per_s = budget.bits_per_s / len(scenario.roster)
        tagged = scenario.radio.key is not None
        two_frames = scenario.radio.longest_frame + longest_frame(0, tagged=tagged) + 2 * budget.overhead
        self._most = max(self._per_s * max(self._step, 1.0), float(BITS * two_frames))
        self._left = dict.fromkeys(run.names, 0.0)
        self._ticks = self._bits = self._longest = self._peak = 0
        self._window: deque[int] = deque(maxlen=max(1, round(WINDOW_S / self._step)))

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the scenario has a budget."""
        return run.prepared.scenario.radio.budget is not None

    def _tick(self, record: TickRecord) -> None:
        if self._ticks:
            earned = self._per_s * self._step
            self._left = {number: min(left + earned, self._most) for number, left in self._left.items()}
        self._ticks += 1
        bits = 0
        for source, frame in record.frames:
            if source not in self._left:  # forged
                continue
            cost = BITS * (len(frame) + self._budget.overhead)
            bits += cost
            self._longest = max(self._longest, len(frame))
            self._left[source] -= cost
            name = self._run.names[source]
            if len(frame) > self._budget.frame:
                self._fail(
                    f"{name} sent {len(frame)} bytes in tick {record.k}, at most {self._budget.frame} are allowed"
                )
            elif self._left[source] < -_ROUNDING:
                over = f"{-self._left[source]:.0f} bits more than its share of {self._per_s:g} bit/s"
                self._fail(f"{name} had sent {over} by tick {record.k}")
        self._bits += bits
        self._window.append(bits)
        self._peak = max(self._peak, sum(self._window))

    def _good(self) -> str:
        used = self._bits / (self._ticks * self._step) if self._ticks else 0.0
        peak = self._peak / (len(self._window) * self._step) if self._window else 0.0
        return (
            f"{used:.0f} of {self._budget.bits_per_s:g} bit/s used, at most {peak:.0f} in {WINDOW_S:g} s; "
            f"the longest frame has {self._longest} of {self._budget.frame} bytes"
        )
