"""Predictors of a patrol: the chance that each point of the ground is seen in each tick to come.

- *future*: what will be seen. Nothing predicts better; the scenario, the code, and the seed or the key of the draws
  tell an intruder as much.
- *code*: the mean of what is seen in 5 futures, simulated from the scenario and the code, with draws of the intruder's
  own in place of the fleet's (`experiments.intruders.simulated_futures`). It plays only where it was asked for.
- *watching*: the forecast of `experiments.intruders.watcher`, from what has been seen so far.
- *picture*: the view of now, for ever.
- *blind*: nothing, so the shortest way.

The *base rate* of a point is the share of the past in which it was seen. Where a forecast is a mean of what followed
some moments, it counts as one more moment: otherwise points that no moment happened to show are as good as any, and an
intruder that plans again every second wanders between them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from experiments.intruders.infiltrator import BEGIN_S
from experiments.intruders.watch import Watch

RATE_EVERY_S = 300.0
"""Time after which the base rate is computed anew, s."""

Chances = NDArray[np.float32]
"""float32 (ahead, points), the chance that each point is seen in each of the ticks to come."""

Predictor = Callable[[int, int], Chances]
"""Takes the tick that was seen last, and for how many ticks to predict; the first one is the next."""


class Past:
    """The past of a run, which several predictors share."""

    def __init__(self, watch: Watch) -> None:
        self.watch = watch
        self.first = watch.ticks_of(BEGIN_S)  # earliest moment that others are compared with
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
        """Return the mean of some futures, uint8 (ahead, points) each, and of the base rate as one more."""
        futures = list(seen)
        total = sum(futures[1:], start=futures[0]) + self.base_rate(now)
        return np.asarray(total * np.float32(1.0 / (len(futures) + 1)))


def predictors_of(past: Past) -> dict[str, Predictor]:
    """Return the predictors of a run that need nothing else, by the names of results."""
    watch = past.watch
    return {
        "future": lambda now, ahead: watch.seen(now + 1, now + 1 + ahead).astype(np.float32),
        "picture": lambda now, ahead: np.repeat(watch.seen(now, now + 1).astype(np.float32), ahead, axis=0),
        "blind": lambda _now, ahead: np.zeros((ahead, watch.size), dtype=np.float32),
    }


def code_predictor(past: Past, futures: Mapping[int, NDArray[np.uint64]]) -> Predictor:
    """Return the predictor `code`.

    Futures are by the tick that was seen last: uint64 (futures, ticks, words), as of `Watch.words`, from the next one.
    """
    return lambda now, ahead: past.mean((past.watch.unpacked(words[:ahead]) for words in futures[now]), now)
