"""Predictors of a patrol: the chance that each point of the ground is seen in each tick to come.

- *future*: what will be seen. Nothing predicts better; the scenario, the code, and the seed or the key of the draws
  tell an intruder as much.
- *code*: the mean of what is seen in 5 futures, simulated from the scenario and the code, with draws of the intruder's
  own in place of the fleet's (`experiments.intruders.simulated_futures`). It plays only where it was asked for.
- *similar*: the 5 moments of the past whose sighting, now and 3 s before, differs in the fewest points (joint analogs);
  the mean of what was seen after them.
- *each*: for each robot the 10 moments of the past in which any robot was nearest to its place, now and 3 s before
  (analogs of each robot: its most likely next turn); what these saw afterwards, robots being independent. Beyond 60 s
  the base rate.
- *picture*: the view of now, for ever.
- *blind*: nothing, so the shortest way.

Moments are at least 5 s apart. The *base rate* of a point is the share of the past in which it was seen. It counts as
one more moment: otherwise points that no moment happened to show are as good as any, and an intruder that plans again
every second wanders between them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from experiments.intruders.infiltrator import BEGIN_S
from experiments.intruders.watch import Watch
from experiments.kernels.footprints import seen_by_none

SIMILAR = 5
"""Moments of *similar*."""

EACH = 10
"""Moments of *each*."""

LAG_S = 3.0
"""Time before a moment at which it must be alike too, s."""

APART_S = 5.0
"""Time between two moments that are taken at least, s."""

ROBOTS_S = 60.0
"""For how long a robot is followed from a moment of its past, s."""

RATE_EVERY_S = 300.0
"""Time after which the base rate is computed anew, s."""

Chances = NDArray[np.float32]
"""float32 (ahead, points), the chance that each point is seen in each of the ticks to come."""

Predictor = Callable[[int, int], Chances]
"""Takes the tick that was seen last, and for how many ticks to predict; the first one is the next."""


class Past:
    """The past of a run, which several predictors share."""

    def __init__(self, watch: Watch, within: int) -> None:
        self.watch = watch
        self.within = within  # ticks that are predicted at most
        self.lag = watch.ticks_of(LAG_S)
        self.apart = watch.ticks_of(APART_S)
        self.first = max(watch.ticks_of(BEGIN_S), self.lag)  # earliest moment that others are compared with
        self._rates: dict[int, Chances] = {}
        self._every = watch.ticks_of(RATE_EVERY_S)

    def base_rate(self, now: int) -> Chances:
        """Return the share of the past in which each point was seen."""
        block = now // self._every
        if block not in self._rates:
            # To the end of the last whole block, so that few are computed.
            last = block * self._every or self.first
            sightings = np.zeros(self.watch.size, dtype=np.int64)
            for begin in range(0, last, self._every):
                sightings += self.watch.seen(begin, min(begin + self._every, last)).sum(axis=0, dtype=np.int64)
            self._rates[block] = (sightings / last).astype(np.float32)
        return self._rates[block]

    def mean(self, seen: Iterable[NDArray[np.uint8]], now: int) -> Chances:
        """Return the mean of some futures, uint8 (ahead, points) each, and the base rate."""
        futures = list(seen)
        total = sum(futures[1:], start=futures[0])
        return self.mixed(total * np.float32(1.0 / len(futures)), len(futures), now)

    def mixed(self, chances: Chances, moments: int, now: int) -> Chances:
        """Mix the base rate into chances from some moments, in place, as one more moment."""
        chances *= np.float32(moments / (moments + 1))
        chances += self.base_rate(now) * np.float32(1.0 / (moments + 1))
        return chances

    @cached_property
    def places(self) -> NDArray[np.float32]:
        """x and y of each robot now and `LAG_S` before, float32 (4, ticks, robots); infinite where it was absent."""
        here = np.moveaxis(self.watch.places, 2, 0)
        before = np.full_like(here, np.inf)
        before[:, self.lag :] = here[:, : -self.lag]
        return np.concatenate([here, before])


def _predict_future(past: Past, now: int, ahead: int) -> Chances:
    return past.watch.seen(now + 1, now + 1 + ahead).astype(np.float32)


def _predict_similar(past: Past, now: int, ahead: int) -> Chances:
    watch, first, last = past.watch, past.first, now - past.within
    differ = np.zeros(last - first, dtype=np.int32)
    for lag in (0, past.lag):
        off = np.bitwise_count(watch.words[first - lag : last - lag] ^ watch.words[now - lag])
        differ += off.sum(axis=1, dtype=np.int32)
    after: list[int] = []
    for _ in range(SIMILAR):
        moment = int(differ.argmin())
        differ[max(moment - past.apart, 0) : moment + past.apart + 1] = np.iinfo(np.int32).max
        after.append(first + moment + 1)
    return past.mean((watch.seen(tick, tick + ahead) for tick in after), now)


def _predict_by_robot(past: Past, now: int, ahead: int) -> Chances:
    watch, robots_ahead = past.watch, past.watch.ticks_of(ROBOTS_S)
    past_places, here = past.places[:, past.first : now - robots_ahead], past.places[:, now]
    present = np.flatnonzero(np.isfinite(here).all(axis=0))
    ticks, robots = (np.zeros((len(present), EACH), dtype=np.int64) for _ in range(2))
    for row, robot in enumerate(present):
        off = np.square(past_places - here[:, robot, None, None]).sum(axis=0)
        for sample in range(EACH):
            moment, past_robot = divmod(int(off.argmin()), off.shape[1])
            ticks[row, sample], robots[row, sample] = past.first + moment, past_robot
            off[max(moment - past.apart, 0) : moment + past.apart + 1, past_robot] = np.inf
    chances = np.empty((ahead, watch.size), dtype=np.float32)
    near = chances[:robots_ahead]
    seen_by_none(watch.looks, watch.first, watch.points, ticks, robots, near)
    np.subtract(np.float32(1.0), near, out=near)
    past.mixed(near, EACH, now)
    chances[robots_ahead:] = past.base_rate(now)
    return chances


def _predict_picture(past: Past, now: int, ahead: int) -> Chances:
    return np.repeat(past.watch.seen(now, now + 1).astype(np.float32), ahead, axis=0)


def _predict_blind(past: Past, now: int, ahead: int) -> Chances:
    del now
    return np.zeros((ahead, past.watch.size), dtype=np.float32)


_PREDICTORS = {
    "future": _predict_future,
    "similar": _predict_similar,
    "each": _predict_by_robot,
    "picture": _predict_picture,
    "blind": _predict_blind,
}


def predictors_of(past: Past) -> dict[str, Predictor]:
    """Return the predictors of a run, by the names of results."""
    return {name: partial(predict, past) for name, predict in _PREDICTORS.items()}


def code_predictor(past: Past, futures: Mapping[int, NDArray[np.uint64]]) -> Predictor:
    """Return the predictor `code`.

    Futures are by the tick that was seen last: uint64 (futures, ticks, words), as of `Watch.words`, from the next one.
    """
    return lambda now, ahead: past.mean((past.watch.unpacked(words[:ahead]) for words in futures[now]), now)
