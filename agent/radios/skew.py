"""Differences between robots' counts of ticks, and late positions, as the positions that they send show them.

Receivers judge a position's tick by their own count. A robot whose count is off rejects the others' positions, or is
rejected by them; it is named. A robot's frames that come much later than most of its last ones are late, whatever it
counts.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping
from statistics import median_low

from patrol.radio.message import CONTACT, Rejected, decode

REMEMBERED = 9
"""Number of frames of each robot by which its count is judged: a few, because some are delayed on the way."""

LONG = 64
"""Number of frames of each robot that tell how late another one is: far more than a link delivers at once, and so many
that a few forged ones make none late."""

LATE_S = 1.0
"""Delay from which a position is not used, s of wall time. Links that repeat what was lost, or hold it back, deliver
some seconds late, and receivers take a position to be of the tick in which it comes."""

APART = 2
"""Largest difference of two counts that is not reported, ticks."""


class Skew:
    """The lead in ticks of other robots' counts over this robot's own, by the positions that they send.

    `late` counts the frames that came too late.
    """

    def __init__(self, names: Mapping[int, str], step_s: float, key: bytes | None = None) -> None:
        """Judge the robots of a fleet; `step_s` is the wall time of a tick.

        With the key of the fleet's tags, frames without the right tag say nothing; it is None where the fleet uses
        none.
        """
        self.late = 0
        self._names = names
        self._key = key
        self._late = max(2 * APART, math.ceil(LATE_S / step_s))
        self._k = -1
        self._leads: dict[int, deque[int]] = {number: deque(maxlen=LONG) for number in names}

    def hear(self, k: int, frames: Iterable[bytes]) -> list[bool]:
        """Take in the frames heard, before the inbox rejects any of them; return which are late.

        A frame is late by the median of its sender's last ones, not by this robot's count: clocks may differ.
        """
        if k != self._k + 1:  # own ticks were skipped, so what has waited meanwhile says nothing about the others
            for leads in self._leads.values():
                leads.clear()
        self._k = k
        return [self._is_late(k, frame) for frame in frames]

    def _is_late(self, k: int, frame: bytes) -> bool:
        try:
            position = decode(frame, self._key)
        except Rejected:
            return False
        if position.robot == CONTACT or position.robot not in self._leads:
            return False
        leads, lead = self._leads[position.robot], position.sequence - k
        leads.append(lead)
        is_late = lead < median_low(leads) - self._late
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
