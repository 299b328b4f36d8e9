"""The predictor that watches: it foresees a patrol from what has been seen of it so far, and from nothing else.

It has two forecasts of the chance that a point is seen in a tick to come:

- *By robots*, for 30 s: each robot goes on like robots did after the 10 moments of the past at which one was nearest to
  its place, now and 3 s before (analogs of each robot: its most likely next turns), robots being independent. The share
  of the past in which a point was seen, its *base rate*, counts as one more moment.
- *By age*: a point is seen as often as points were that had been unseen for as long. Ages are told apart by 2 s, up to
  240 s. The table is learned anew each minute.

While robots are followed, the odds of both are multiplied, and divided by those of the base rate, which both contain;
later, the chance is that by age. For example, with 0.5 by robots, 0.2 by age and a base rate of 0.1 the odds are
1 * 0.25 / 0.11 = 2.25, and the chance is 0.69.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from experiments.intruders.predictors import Chances, Past
from experiments.kernels.footprints import seen_by_none

ANALOGS = 10
"""Moments that each robot is likened to."""

LAG_S = 3.0
"""Time before a moment at which it must be alike too, s."""

APART_S = 5.0
"""Time between two moments that are taken at least, s."""

FOLLOWED_S = 30.0
"""For how long a robot is followed from a moment of its past, s."""

AGE_BIN_S = 2.0
"""Difference of ages that are told apart, and of the times ahead for which chances by age are learned, s."""

AGE_BINS = 120
"""Number of ages that are told apart; the last one holds all older points."""

LEARN_EVERY_S = 60.0
"""Time after which the chances by age are learned anew, s."""

FEW = 100
"""Points of an age that the mean of all ages counts as, so that a few points of a rare age do not look certain."""

DOUBT = 0.01
"""Least chance of a sighting, and of none, by age and of the base rate, so that no age overrules all analogs."""


class WatchingPredictor:
    """The predictor `watching` of a run."""

    def __init__(self, past: Past, within: int) -> None:
        """Begin with nothing learned; at most `within` ticks are predicted."""
        self._past = past
        self._watch = watch = past.watch
        self._within = within
        self._apart = watch.ticks_of(APART_S)
        self._followed = watch.ticks_of(FOLLOWED_S)
        lag = watch.ticks_of(LAG_S)
        here = np.moveaxis(watch.places, 2, 0)
        before = np.full_like(here, np.inf)
        before[:, lag:] = here[:, :-lag]
        # x and y now and before, float32 (4, ticks, robots); infinite where a robot was absent
        self._places = np.concatenate([here, before])
        self._bin = watch.ticks_of(AGE_BIN_S)
        self._every = watch.ticks_of(LEARN_EVERY_S)
        # ticks ahead for which chances by age are learned: the middle of each bin
        self._leads = np.minimum(np.arange(0, within, self._bin) + 1 + self._bin // 2, within)
        self._moment = past.first  # the next one to learn from
        self._seen = np.zeros((len(self._leads), AGE_BINS))  # how many points were seen, by lead and age
        self._points = np.zeros(AGE_BINS)  # of how many, by age
        self._tables: list[Chances] = []  # chances by lead and age, learned up to each minute

    def __call__(self, now: int, ahead: int) -> Chances:
        """Return the chances for `ahead` ticks after the tick `now`, which was seen last."""
        table = self._table(now)[np.arange(ahead) // self._bin]
        chances = np.take(table, self._ages(now), axis=1)
        # The base rate counts as one more moment beside the analogs.
        rate = _doubted(self._past.base_rate(now))
        followed = chances[: self._followed]
        by_robots = (self._follow_robots(now, len(followed)) * np.float32(ANALOGS) + rate) / np.float32(ANALOGS + 1)
        odds = _odds(by_robots) * _odds(_doubted(followed)) / _odds(rate)
        np.divide(odds, np.float32(1.0) + odds, out=followed)
        return chances

    def _follow_robots(self, now: int, ahead: int) -> Chances:
        """Return the chances by what robots did after the moments that each is likened to."""
        watch, first = self._watch, self._past.first
        # All that followed these moments has been seen.
        past_places, here = self._places[:, first : now + 1 - self._followed], self._places[:, now]
        present = np.flatnonzero(np.isfinite(here).all(axis=0))
        ticks, robots = (np.zeros((len(present), ANALOGS), dtype=np.int64) for _ in range(2))
        for row, robot in enumerate(present):
            off = np.square(past_places - here[:, robot, None, None]).sum(axis=0)
            for sample in range(ANALOGS):
                moment, past_robot = divmod(int(off.argmin()), off.shape[1])
                ticks[row, sample], robots[row, sample] = first + moment, past_robot
                off[max(moment - self._apart, 0) : moment + self._apart + 1, past_robot] = np.inf
        chances = np.empty((ahead, watch.size), dtype=np.float32)
        seen_by_none(watch.looks, watch.first, watch.points, ticks, robots, chances)
        return np.subtract(np.float32(1.0), chances, out=chances)

    def _table(self, now: int) -> Chances:
        """Return the chances by lead and age, from all moments whose future had been seen by the last whole minute."""
        while len(self._tables) <= now // self._every:
            last = len(self._tables) * self._every - self._within
            while self._moment <= last:
                self._learn(self._moment)
                # One tick more, so that a patrol that changes every 5 s is met before, during and after its changes.
                self._moment += self._apart + 1
            mean = self._seen.sum(axis=1, keepdims=True) / max(self._points.sum(), 1.0)
            self._tables.append(((self._seen + FEW * mean) / (self._points + FEW)).astype(np.float32))
        return self._tables[now // self._every]

    def _learn(self, moment: int) -> None:
        """Count which points were seen after a moment, by their age then."""
        ages = self._ages(moment)
        leads, points = np.nonzero(self._watch.unpacked(self._watch.words[moment + self._leads]))
        self._seen += np.bincount(leads * AGE_BINS + ages[points], minlength=self._seen.size).reshape(self._seen.shape)
        self._points += np.bincount(ages, minlength=AGE_BINS)

    def _ages(self, tick: int) -> NDArray[np.int64]:
        """Return the age of each point in a tick, in bins; of a point never seen, since the run began."""
        bins = min(AGE_BINS - 1, (tick + 1) // self._bin)
        words = self._watch.words[tick + 1 - bins * self._bin : tick + 1]
        seen = self._watch.unpacked(np.bitwise_or.reduce(words.reshape(bins, self._bin, -1), axis=1))[::-1]
        return np.where(seen.any(axis=0), seen.argmax(axis=0), bins)


def _doubted(chances: Chances) -> Chances:
    return np.clip(chances, np.float32(DOUBT), np.float32(1.0 - DOUBT))


def _odds(chances: Chances) -> Chances:
    return chances / (np.float32(1.0) - chances)
