"""Comparison of the round with free choices, made while the robot patrols: the fresher one is kept.

A round promises an MFoW of its length by the speed of all robots together. In small rooms, narrow doors and with bodies
that get into each other's way it may not keep that. Then the next period goes by free choices, and those after it by
what was better. Crowded robots do so even after a round that keeps its promise. Every sixth period begins on the round
again. Periods count from tick 0 and all robots believe nearly the same fog, so they agree; one that joins later does so
at the next beginning at the latest.

    period          0      1      2      3      4      5      6   ...
                    round  free   free   free   free   free   round
    MFoW/promised   1.5    0.9    0.9    1.0    0.9    0.9    1.5
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

PERIODS = 6
"""Periods after which the robots begin on the round again."""


class Comparison:
    """Compares the two by the MFoW that the robot believes in, in the second half of each period."""

    def __init__(self, step: float, tour_s: float, robots: int, crowded: bool) -> None:
        self.on_round = True  # whether the robots should follow the round now
        self._tour_s = tour_s  # time that one robot takes for the round
        # Crowded robots see most of what lies before another one on the round, which promises too little then.
        self._broken = 0.0 if crowded else BROKEN
        self._step = step
        self._length = max(PERIOD_S, 4.0 * tour_s / robots) / step
        self._period = -1
        self._whole = False  # whether the present period was noted from its beginning
        self._ratios: list[float] = []
        self._means: dict[bool, float] = {}  # by `on_round`: MFoW by what the round promises

    def note(self, view: View, robots: int, is_lossy: bool) -> None:
        """Take note of the fog of a tick, and of how many robots are on the round; decide where a period begins.

        ``is_lossy`` is True where many positions are lost: what robots believe says little, so they keep to the round.
        """
        period, share = divmod(view.tick / self._length, 1.0)
        if period != self._period:
            # A robot that joins during a period has not seen enough to judge it.
            self._whole = share * self._length < 1.0
            self._begin(int(period))
        if is_lossy:
            self.on_round, self._whole = True, False
            self._means.clear()
            self._ratios.clear()
        elif self._whole and share >= 0.5:
            self._ratios.append(view.fog.mfow(view.tick) * self._step * robots / self._tour_s)

    def _begin(self, period: int) -> None:
        if self._ratios:
            self._means[self.on_round] = sum(self._ratios) / len(self._ratios)
        if period % PERIODS == 0:
            self._means.clear()
        on_round = self._means.get(True, 0.0)
        self.on_round = on_round <= self._means.get(False, 0.0 if on_round > self._broken else math.inf)
        self._period, self._ratios = period, []
