"""The ticks of a fleet as a robot counts them without a world, and the differences between robots' counts.

Tick k begins at ``epoch + k * step`` on a clock that all robots share, such as Unix time. Receivers judge a position's
tick by their own count. A robot whose count is off rejects the others' positions and is rejected by them; `Skew`
notices and reports it.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from statistics import median_low

from patrol.net.messages.phases import PHASE_B_SHARE
from patrol.radio.message import CONTACT, Rejected, decode

REMEMBERED = 9
"""Number of frames of each robot by which its count is judged: a few, because some are delayed on the way."""

APART = 2
"""Largest difference of two counts that is not reported, ticks."""


class KeptClock:
    """An `agent.ports.FleetClock` that the robot keeps itself."""

    def __init__(self, step_s: float, epoch_s: float, now: Callable[[], float], leave: Callable[[float], bool]) -> None:
        """Begin with the current tick.

        Args:
            step_s: Wall time of a tick, s.
            epoch_s: When tick 0 began on the shared clock, s.
            now: The shared clock, s.
            leave: Waits for a number of seconds; True as soon as it is time to leave.
        """
        self._step_s = step_s
        self._epoch_s = epoch_s
        self._now = now
        self._leave = leave
        self._k = -1

    def tick(self) -> int | None:
        """Wait for the next tick, skipping those that have passed meanwhile; None when it is time to leave."""
        passed = math.floor((self._now() - self._epoch_s) / self._step_s)
        self._k = max(self._k + 1, passed, 0)
        return None if self._wait_until(self._begin) else self._k

    def decide(self) -> bool:
        """Wait until this tick's positions should have come; False when the tick is over or it is time to leave."""
        if self._wait_until(self._begin + PHASE_B_SHARE * self._step_s):
            return False
        return self._now() < self._begin + self._step_s

    @property
    def _begin(self) -> float:
        return self._epoch_s + self._k * self._step_s

    def _wait_until(self, moment: float) -> bool:
        """Wait; True when it is time to leave."""
        while (left := moment - self._now()) > 0.0:
            if self._leave(left):
                return True
        return self._leave(0.0)


class Skew:
    """The lead in ticks of other robots' counts over this robot's own, by the positions that they send."""

    def __init__(self, names: Mapping[int, str], tolerated: int = APART) -> None:
        """Judge the robots of a fleet.

        Args:
            names: The robots' names, by number.
            tolerated: Largest difference that is not reported, ticks.
        """
        self._names = names
        self._tolerated = tolerated
        self._k = -1
        self._leads: dict[int, deque[int]] = {number: deque(maxlen=REMEMBERED) for number in names}

    def hear(self, k: int, frames: Iterable[bytes]) -> None:
        """Take in the frames heard, before the inbox rejects any of them.

        Args:
            k: The tick for whose decision they were heard.
            frames: As they were received.
        """
        if k != self._k + 1:  # own ticks were skipped, so what has waited meanwhile says nothing about the others
            for leads in self._leads.values():
                leads.clear()
        self._k = k
        for frame in frames:
            try:
                position = decode(frame)
            except Rejected:
                continue
            if position.robot != CONTACT and position.robot in self._leads:
                self._leads[position.robot].append(position.sequence - k)

    @property
    def ticks(self) -> dict[str, int]:
        """The lead of each robot's count in ticks (negative: behind), by name, for robots heard often enough."""
        full = {number: leads for number, leads in self._leads.items() if len(leads) == REMEMBERED}
        return {self._names[number]: median_low(leads) for number, leads in full.items()}

    def complaint(self) -> str | None:
        """Return one line about the robots that count differently; None when there are none."""
        leads = {name: lead for name, lead in self.ticks.items() if abs(lead) > self._tolerated}
        if not leads:
            return None
        counts = ", ".join(
            f"{name} is {abs(lead)} ticks {'ahead' if lead > 0 else 'behind'}" for name, lead in leads.items()
        )
        return f"ticks differ: {counts}, so positions are refused; set NTP and the same epoch on all robots"


def epoch_of(frame: bytes, heard_s: float, step_s: float, key: bytes | None = None) -> float | None:
    """Compute when tick 0 began, by a position that has just been heard.

    Args:
        frame: As it was received. Without a key it may be forged.
        heard_s: When it was received, on the shared clock, s.
        step_s: Wall time of a tick, s.
        key: Of the fleet's tags, which the frame must bear then, or None.

    Returns:
        Time on the shared clock, s; None for a frame that holds no robot's position.
    """
    try:
        position = decode(frame, key)
    except Rejected:
        return None
    return None if position.robot == CONTACT else heard_s - position.sequence * step_s
