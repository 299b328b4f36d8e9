"""Predictors of a patrol: the chance that each point of the ground is seen in each tick to come.

- *future*: what will be seen. Nothing predicts better; the scenario, the code, and the seed or the key of the draws
  tell an intruder as much.
- *code*: the mean of what is seen in 5 futures, simulated from the scenario and the code, with draws of the intruder's
  own in place of the fleet's (`experiments.intruders.simulated_futures`). It plays only where it was asked for.
- *watching*: from what has been seen so far. It has two forecasts. *By robots*: each robot goes on like robots did
  after the 10 moments of the past at which one was nearest to its place, now and 3 s before (analogs of each robot: its
  most likely next turns), robots being independent. *By age*: a point is seen as often as points were that had been
  unseen for as long. For 30 s the odds of both are multiplied, and divided by those of the base rate, which both
  contain; later, the chance is that by age. For example, with 0.5 by robots, 0.2 by age and a base rate of 0.1 the odds
  are 1 * 0.25 / 0.11 = 2.25, and the chance is 0.69.
- *picture*: the view of now, for ever.
- *blind*: nothing, so the shortest way.

The *base rate* of a point is the share of the past in which it was seen. It counts as one more future, or moment:
otherwise points that none of them happened to show are as good as any, and an intruder that plans again every second
wanders between them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from experiments.intruders.infiltrator import BEGIN_S, WATCHING
from experiments.intruders.watch import Watch
from experiments.kernels.footprints import seen_by_none

ANALOGS = 10
"""Moments that each robot is likened to."""

LAG_S = 3.0
"""Time before a moment at which it must be alike too, s."""

APART_S = 5.0
"""Time between two moments that are taken at least, s."""

FOLLOWED_S = 30.0
"""For how long a robot is followed from a moment of its past, s."""

AGE_BIN_S, AGE_BINS = 2.0, 120
"""Difference of ages that are told apart, and of times ahead, s; the number of ages, of which the last is all older."""

LEARN_EVERY_S, RATE_EVERY_S = 60.0, 300.0
"""Time after which the chances by age, and the base rate, are computed anew, s."""

FEW = 100
"""Points of an age that the mean of all ages counts as, so that a few points of a rare age do not look certain."""

DOUBT = 0.01
"""Least chance of a sighting, and of none, by age and of the base rate, so that no age overrules all analogs."""

Chances = NDArray[np.float32]
"""float32 (ahead, points), the chance that each point is seen in each of the ticks to come."""

Predictor = Callable[[int, int], Chances]
"""Takes the tick that was seen last, and for how many ticks to predict; the first one is the next."""


class Past:
    """The past of a run up to any tick, and what an intruder that watches expects from it."""

    def __init__(self, watch: Watch, within: int) -> None:
        """Begin with nothing learned; at most `within` ticks are predicted."""
        self.watch = watch
        self._within = within
        self._first = watch.ticks_of(BEGIN_S)  # earliest moment that others are compared with
        self._apart, self._followed, lag = map(watch.ticks_of, (APART_S, FOLLOWED_S, LAG_S))
        here = np.moveaxis(watch.places, 2, 0)
        # x and y now and before (from `_first` on), float32 (4, ticks, robots); infinite where a robot was absent
        self._places = np.concatenate([here, np.roll(here, lag, axis=1)])
        self._bin, self._learn_every, self._rate_every = map(watch.ticks_of, (AGE_BIN_S, LEARN_EVERY_S, RATE_EVERY_S))
        self._rates: dict[int, Chances] = {}  # base rates
        # ticks ahead for which chances by age are learned: the middle of each bin
        self._leads = np.minimum(np.arange(0, within, self._bin) + 1 + self._bin // 2, within)
        self._moment = self._first  # the next one to learn from
        self._seen = np.zeros((len(self._leads), AGE_BINS))  # how many points were seen, by lead and age
        self._points = np.zeros(AGE_BINS)  # of how many, by age
        self._tables: list[Chances] = []  # chances by lead and age, learned up to each minute

    def base_rate(self, now: int) -> Chances:
        """Return the share of the past in which each point was seen."""
        block = now // self._rate_every
        if block not in self._rates:
            # To the end of the last whole block, so that few are computed.
            last = block * self._rate_every or self._first
            sightings = np.zeros(self.watch.size, dtype=np.int64)
            for begin in range(0, last, self._rate_every):
                sightings += self.watch.seen(begin, min(begin + self._rate_every, last)).sum(axis=0, dtype=np.int64)
            self._rates[block] = (sightings / last).astype(np.float32)
        return self._rates[block]

    def watching(self, now: int, ahead: int) -> Chances:
        """Return the chances of *watching*, as a `Predictor` does."""
        table = self._table(now)[np.arange(ahead) // self._bin]
        chances = np.take(table, self._ages(now), axis=1)
        followed = chances[: self._followed]
        limits = np.float32(DOUBT), np.float32(1.0 - DOUBT)
        rate, by_age = np.clip(self.base_rate(now), *limits), np.clip(followed, *limits)
        by_robots = (self._follow_robots(now, len(followed)) * np.float32(ANALOGS) + rate) / np.float32(ANALOGS + 1)
        odds = _odds(by_robots) * _odds(by_age) / _odds(rate)
        np.divide(odds, np.float32(1.0) + odds, out=followed)
        return chances

    def _follow_robots(self, now: int, ahead: int) -> Chances:
        """Return the chances by what robots did after the moments that each is likened to."""
        watch, first = self.watch, self._first
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
        while len(self._tables) <= now // self._learn_every:
            while self._moment <= len(self._tables) * self._learn_every - self._within:
                ages = self._ages(self._moment)
                leads, points = np.nonzero(self.watch.unpacked(self.watch.words[self._moment + self._leads]))
                sightings = np.bincount(leads * AGE_BINS + ages[points], minlength=self._seen.size)
                self._seen += sightings.reshape(self._seen.shape)
                self._points += np.bincount(ages, minlength=AGE_BINS)
                # One tick more, so that a patrol that changes every 5 s is met before, during and after its changes.
                self._moment += self._apart + 1
            mean = self._seen.sum(axis=1, keepdims=True) / max(self._points.sum(), 1.0)
            self._tables.append(((self._seen + FEW * mean) / (self._points + FEW)).astype(np.float32))
        return self._tables[now // self._learn_every]

    def _ages(self, tick: int) -> NDArray[np.int64]:
        """Return the age of each point in a tick, in bins; of a point never seen, since the run began."""
        bins = min(AGE_BINS - 1, (tick + 1) // self._bin)
        words = self.watch.words[tick + 1 - bins * self._bin : tick + 1]
        seen = self.watch.unpacked(np.bitwise_or.reduce(words.reshape(bins, self._bin, -1), axis=1))[::-1]
        return np.where(seen.any(axis=0), seen.argmax(axis=0), bins)


def predictors_of(past: Past) -> dict[str, Predictor]:
    """Return the predictors of a run that need nothing else, by the names of results."""
    watch = past.watch
    return {
        "future": lambda now, ahead: watch.seen(now + 1, now + 1 + ahead).astype(np.float32),
        "picture": lambda now, ahead: np.repeat(watch.seen(now, now + 1).astype(np.float32), ahead, axis=0),
        "blind": lambda _now, ahead: np.zeros((ahead, watch.size), dtype=np.float32),
        WATCHING: past.watching,
    }


def code_predictor(past: Past, futures: Mapping[int, NDArray[np.uint64]]) -> Predictor:
    """Return the predictor `code`, from futures by the tick that was seen last: uint64 (futures, ticks, words)."""

    def predict(now: int, ahead: int) -> Chances:
        counts = np.sum([past.watch.unpacked(words[:ahead]) for words in futures[now]], axis=0, dtype=np.float32)
        return np.asarray((counts + past.base_rate(now)) * np.float32(1.0 / (len(futures[now]) + 1)))

    return predict


def _odds(chances: Chances) -> Chances:
    return chances / (np.float32(1.0) - chances)
