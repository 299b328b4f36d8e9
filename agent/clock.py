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

LONG = 64
"""Number of frames of each robot whose quickest tells how late another one is: more than a link delivers at once."""

LATE_S = 1.0
"""Delay from which a position is not used, s of wall time. Links that repeat what was lost, or hold it back, deliver
some seconds late, and receivers take a position to be of the tick in which it comes."""

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
    """The lead in ticks of other robots' counts over this robot's own, by the positions that they send.

    Attributes:
        late: Number of frames that came too late.
    """

    def __init__(self, names: Mapping[int, str], step_s: float) -> None:
        """Judge the robots of a fleet.

        Args:
            names: The robots' names, by number.
            step_s: Wall time of a tick, s.
        """
        self.late = 0
        self._names = names
        self._late = max(2 * APART, math.ceil(LATE_S / step_s))
        self._k = -1
        self._leads: dict[int, deque[int]] = {number: deque(maxlen=LONG) for number in names}

    def hear(self, k: int, frames: Iterable[bytes]) -> list[bool]:
        """Take in the frames heard, before the inbox rejects any of them; return which are late.

        A frame is late by its sender's quickest of late, not by this robot's count: clocks may differ.

        Args:
            k: The tick for whose decision they were heard.
            frames: As they were received.
        """
        if k != self._k + 1:  # own ticks were skipped, so what has waited meanwhile says nothing about the others
            for leads in self._leads.values():
                leads.clear()
        self._k = k
        return [self._is_late(k, frame) for frame in frames]

    def _is_late(self, k: int, frame: bytes) -> bool:
        try:
            position = decode(frame)
        except Rejected:
            return False
        if position.robot == CONTACT or position.robot not in self._leads:
            return False
        leads, lead = self._leads[position.robot], position.sequence - k
        leads.append(lead)
        is_late = lead < max(leads) - self._late
        self.late += is_late
        return is_late

    @property
    def ticks(self) -> dict[str, int]:
        """The lead of each robot's count in ticks (negative: behind), by name, for robots heard often enough."""
        newest = {number: list(leads)[-REMEMBERED:] for number, leads in self._leads.items()}
        return {self._names[number]: median_low(leads) for number, leads in newest.items() if len(leads) == REMEMBERED}

    def complaint(self) -> str | None:
        """Return one line about the robots that count differently; None when there are none."""
        leads = {name: lead for name, lead in self.ticks.items() if abs(lead) > APART}
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
