"""Periods: when a fleet follows the round, and when each robot chooses freely.

The time is cut into periods of equal length. In each period all robots do the same, without saying so, because all work
it out from what all of them know: the scenario's seed, and the fog that they rebuild from the positions they hear.

- *By chance*: with the probability `unpredictability` a period is free, by a draw that is the same for all robots.
- *By experience*: otherwise the robots follow the round, as long as it keeps the fog about as fresh as its length
  promises. Where it does not, because bodies turn slowly or get into each other's way, they choose freely for a period,
  and from then on do what has kept the fog fresher.

For example, a round that promises that nothing gets older than 60 s, and in whose second period the stalest point was
100 s old in the mean, is followed by a free period. If that point was 80 s old in it, the fleet goes on choosing
freely.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

INTERVALS = 6.0
"""Length of a period, in times between two robots of an evenly spaced round."""

GOOD = 1.75
"""A round is kept to while the stalest point is on average no older than so many times between two robots."""

SETTLED = 0.5
"""Share of a period after which its fog is its own, and not that of the period before."""

CERTAIN = 0.98
"""Share of that part's ticks in which a robot has to hear all others, or it learns nothing from the period."""

WEIGHT = 0.5
"""Weight of the last period in what a fleet has experienced."""


@dataclass(slots=True)
class Periods:
    """The periods of one robot's fleet.

    Attributes:
        length: Of a period, ticks.
        unpredictability: Share of the periods that are free by chance.
        chance: A random number in [0, 1) for a period, the same for all robots.
        since: Tick from which the robots follow this round; the period in which it lies teaches nothing.
        round_now: Whether the robots follow the round in this period.
        experience: Mean age of the stalest point in settled periods on the round (True) and free ones (False), ticks.
    """

    length: int
    unpredictability: float
    chance: Callable[[int], float]
    since: int = 0
    round_now: bool = False
    experience: dict[bool, float] = field(default_factory=dict)
    _period: int = -1
    _team: int = 0
    _ages: int = 0
    _ticks: int = 0
    _certain: int = 0

    def update(self, tick: int, mfow: int, team: int, interval: float, *, certain: bool) -> bool:
        """Return True if the robots follow the round at a tick.

        Args:
            tick: Now; each tick once, or at least once in a period.
            mfow: Believed age of the stalest point, ticks.
            team: Number of robots that take part.
            interval: Time between two of them on an evenly spaced round, ticks.
            certain: Whether all of them have been heard in this tick.
        """
        period = tick // self.length
        if period != self._period:
            self._learn()
            if team != self._team:
                self.experience.clear()
                self._team = team
            self._period = period
            self.round_now = self.chance(period) >= self.unpredictability and self._is_worth_it(interval)
        begun = tick % self.length
        if begun >= SETTLED * self.length and tick - begun >= self.since:
            self._ages += mfow
            self._ticks += 1
            self._certain += certain
        return self.round_now

    def _learn(self) -> None:
        if self._ticks > 0 and self._certain >= CERTAIN * self._ticks:
            mean = self._ages / self._ticks
            before = self.experience.get(self.round_now, mean)
            self.experience[self.round_now] = before + WEIGHT * (mean - before)
        self._ages = self._ticks = self._certain = 0

    def _is_worth_it(self, interval: float) -> bool:
        """Return True if the round is better than free choices, as far as is known."""
        known = self.experience.get(True)
        if known is None or known <= GOOD * interval:
            return True
        return known <= self.experience.get(False, 0.0)
