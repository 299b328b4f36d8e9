"""Which keeps the ground fresher here, the round or free choices: compared while the robot patrols.

A round promises an MFoW of its length by the speed of all robots together. In small rooms, narrow doors and with bodies
that get into each other's way it may not keep that. Then the next period goes by free choices, and after it by what
was better; each is tried again from time to time. All robots believe nearly the same fog, so they agree.

    period    1      2      3      4      5   ...
              round  free   free   free   free, round again in the 8th
    MFoW, s   60     36     35     37
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from agent.view import View

PERIOD_S = 300.0
"""Length of a period, s; at least four times what the round promises."""

BROKEN = 1.3
"""MFoW by what the round promises from which on free choices are tried."""

REMEMBERED = 6
"""Periods after which the robots no longer trust what they have measured."""


class Comparison:
    """Compares the two by the MFoW that the robot believes in, in the second half of each period."""

    def __init__(self, step: float, tour_s: float) -> None:
        self.on_round = True  # whether the robots should follow the round now
        self._step = step
        self._tour_s = tour_s  # time that one robot takes for the round
        self._period = 0
        self._mfow_s: list[float] = []
        self._means: dict[bool, tuple[int, float]] = {}  # by `on_round`: the latest period, and its mean MFoW

    def note(self, view: View, robots: int) -> None:
        """Take note of the fog of a tick; at the end of a period, say how the next one goes."""
        promised_s = self._tour_s / robots
        period, share = divmod(view.tick * self._step / max(PERIOD_S, 4.0 * promised_s), 1.0)
        if period != self._period:
            self._end(promised_s)
            self._period = int(period)
        elif share >= 0.5:
            self._mfow_s.append(view.fog.mfow(view.tick) * self._step)

    def _end(self, promised_s: float) -> None:
        if self._mfow_s:
            self._means[self.on_round] = self._period, sum(self._mfow_s) / len(self._mfow_s)
        means = {way: mean for way, (at, mean) in self._means.items() if self._period - at < REMEMBERED}
        on_round = means.get(True, 0.0)
        self.on_round = on_round <= means.get(False, 0.0 if on_round > BROKEN * promised_s else math.inf)
        self._mfow_s = []
