"""A fleet's ticks, counted by a robot that no world tells them, and how far apart robots count.

Tick k begins at ``epoch + k * step`` of a clock that all robots share, such as Unix time. Receivers judge a position's
tick by their own, so a robot whose count is off is refused by others and refuses them; `Skew` notices and says so.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from statistics import median_low

from patrol.net.phases import PHASE_B_SHARE
from patrol.radio.message import CONTACT, Rejected, decode

REMEMBERED = 9
"""Frames of each robot by which its count is judged: a few, for some are held up on their way."""

APART = 2
"""Differences of up to so many ticks are not reported."""


class KeptClock:
    """A `agent.ports.FleetClock` that a robot keeps itself."""

    def __init__(self, step_s: float, epoch_s: float, now: Callable[[], float], leave: Callable[[float], bool]) -> None:
        """Begin with the tick that it is now.

        Args:
            step_s: Wall time of a tick, s.
            epoch_s: When tick 0 began by the shared clock, s.
            now: The shared clock, s.
            leave: Waits for so many seconds; True as soon as it is time to leave.
        """
        self._step_s = step_s
        self._epoch_s = epoch_s
        self._now = now
        self._leave = leave
        self._k = -1

    def tick(self) -> int | None:
        """Wait for the next tick; ticks that have passed meanwhile are left out. None when it is time to leave."""
        passed = math.floor((self._now() - self._epoch_s) / self._step_s)
        self._k = max(self._k + 1, passed, 0)
        return None if self._wait_until(self._begin) else self._k

    def decide(self) -> bool:
        """Wait until this tick's positions should have come; False when it is over or it is time to leave."""
        if self._wait_until(self._begin + PHASE_B_SHARE * self._step_s):
            return False
        return self._now() < self._begin + self._step_s

    @property
    def _begin(self) -> float:
        return self._epoch_s + self._k * self._step_s

    def _wait_until(self, moment: float) -> bool:
        """Whether it is time to leave."""
        while (left := moment - self._now()) > 0.0:
            if self._leave(left):
                return True
        return self._leave(0.0)


class Skew:
    """How many ticks other robots' counts are ahead of one's own, by what they send."""

    def __init__(self, names: Mapping[int, str], tolerated: int = APART) -> None:
        """Judge the robots of a fleet.

        Args:
            names: By number.
            tolerated: Ticks of difference that are not reported.
        """
        self._names = names
        self._tolerated = tolerated
        self._k = -1
        self._leads: dict[int, deque[int]] = {number: deque(maxlen=REMEMBERED) for number in names}

    def hear(self, k: int, frames: Iterable[bytes]) -> None:
        """Take in what has been heard for the decision of tick k, before anybody refuses any of it."""
        if k != self._k + 1:  # one's own ticks were left out, so what has waited meanwhile tells nothing
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
        """By name of each robot heard often enough: by how many ticks its count is ahead (negative: behind)."""
        full = {number: leads for number, leads in self._leads.items() if len(leads) == REMEMBERED}
        return {self._names[number]: median_low(leads) for number, leads in full.items()}

    def complaint(self) -> str | None:
        """One line on the robots that count differently; None when there are none."""
        off = {name: lead for name, lead in self.ticks.items() if abs(lead) > self._tolerated}
        if not off:
            return None
        counts = ", ".join(
            f"{name} is {abs(lead)} ticks {'ahead' if lead > 0 else 'behind'}" for name, lead in off.items()
        )
        return f"ticks differ: {counts}, so positions are refused; set NTP and the same epoch on all robots"


def epoch_of(frame: bytes, heard_s: float, step_s: float, key: bytes | None = None) -> float | None:
    """When tick 0 began, by a position that has just been heard; None for one that carries no position.

    Args:
        frame: As it was received. Without a key anybody can send one.
        heard_s: When, by the shared clock, s.
        step_s: Wall time of a tick, s.
        key: Of the fleet's tags, which the frame must bear then, or None.
    """
    try:
        position = decode(frame, key)
    except Rejected:
        return None
    return None if position.robot == CONTACT else heard_s - position.sequence * step_s
