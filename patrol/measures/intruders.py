"""Intruder games: how often somebody who watches a patrol could stay at a place unseen for as long as an attack takes.

Three intruders of the literature (Sak, Wainer and Goldenstein, "Probabilistic multiagent patrolling", SBIA 2008; Ward
and Hunt, "An empirical method for benchmarking multi-robot patrol strategies in adversarial environments", SAC 2023).
An attack that begins at tick t succeeds where nobody sees the place in the ticks t + 1 to t + a. One that would not end
before the run does is none.

- *Random* attacks any place at any tick. Its share of successes is computed over all of them, not drawn.
- *Waiting* attacks as soon as the place has just been left.
- *Statistical* knows the times for which the place was unseen in the first half of the run. In the second half it
  attacks whenever the place has been unseen for the time after which, by the first half, success is most likely.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SAMPLES = 5
"""Least number of times that a place was unseen by which the statistical intruder judges it; else by those of all."""

Seen = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Successes:
    """Shares of attacks that succeed, each the mean over places; None where there was no attack.

    Attributes:
        attack_s: Duration of an attack, s.
        random: Of the random intruder.
        waiting: Of the waiting intruder.
        statistical: Of the statistical intruder.
        worst: The greatest of these.
    """

    attack_s: float
    random: float | None
    waiting: float | None
    statistical: float | None

    @property
    def worst(self) -> float | None:
        """The share of the intruder that succeeds most often."""
        return max(
            (share for share in (self.random, self.waiting, self.statistical) if share is not None), default=None
        )


def intruder_games(seen: Seen, step: float, attacks_s: Sequence[float]) -> list[Successes]:
    """Play the games on a run.

    Args:
        seen: bool (ticks, places), whether a robot saw (or visited) each place in each tick.
        step: Length of a tick, s.
        attacks_s: Durations of attacks, s.

    Returns:
        The shares, for each duration.
    """
    free = _unseen_after(seen)
    stays = [unseen_times(seen[: len(seen) // 2, place]) for place in range(seen.shape[1])]
    found = []
    for attack_s in attacks_s:
        ticks = max(round(attack_s / step), 1)
        found.append(
            Successes(
                attack_s, _random(free, ticks), _waiting(seen, free, ticks), _statistical(seen, free, stays, ticks)
            )
        )
    return found


def _unseen_after(seen: Seen) -> NDArray[np.int64]:
    """int64 (ticks, places): for how many ticks from the next one on a place stays unseen; to the run's end at most."""
    free = np.zeros(seen.shape, dtype=np.int64)
    for k in range(len(seen) - 2, -1, -1):
        free[k] = np.where(seen[k + 1], 0, free[k + 1] + 1)
    return free


def unseen_times(seen: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return for how many ticks each a place was unseen between two times at which it was seen.

    Args:
        seen: bool (ticks,).
    """
    gaps = np.diff(np.flatnonzero(seen)) - 1
    return gaps[gaps > 0]


def _random(free: NDArray[np.int64], ticks: int) -> float | None:
    began = free[: max(len(free) - ticks, 0)]
    return float((began >= ticks).mean()) if began.size else None


def _waiting(seen: Seen, free: NDArray[np.int64], ticks: int) -> float | None:
    last = max(len(seen) - ticks, 0)
    left = seen[:last] & (free[:last] > 0)
    return _mean_share(left, free[:last] >= ticks)


def _statistical(seen: Seen, free: NDArray[np.int64], stays: list[NDArray[np.int64]], ticks: int) -> float | None:
    begin, last = len(seen) // 2, max(len(seen) - ticks, 0)
    every = np.concatenate(stays) if stays else np.zeros(0, dtype=np.int64)
    attacks = np.zeros(seen.shape, dtype=np.bool_)
    for place, own in enumerate(stays):
        known = own if len(own) >= SAMPLES else every
        if len(known):
            wait = best_wait(known, ticks)
            attacks[:, place] = _since(seen[:, place]) == wait
            if wait == 0:
                attacks[:, place] &= free[:, place] > 0
    attacks[:begin] = False
    return _mean_share(attacks[:last], free[:last] >= ticks)


def best_wait(times: NDArray[np.int64], ticks: int) -> int:
    """Return after how many unseen ticks an attack is most likely to succeed; of equally good ones the least.

    Args:
        times: int64 (n,), for how many ticks a place was unseen each time.
        ticks: Of the attack.
    """
    best, most = 0, -1.0
    for wait in [0, *(np.unique(times) + 1).tolist()]:
        reached = int((times >= wait).sum())
        share = float((times >= wait + ticks).sum()) / max(reached, 1)
        if share > most and reached >= min(SAMPLES, len(times)):
            best, most = wait, share
    return best


def _since(seen: NDArray[np.bool_]) -> NDArray[np.int64]:
    """int64 (ticks,): for how many ticks a place has been unseen, this one included; 0 where it is seen."""
    ticks = np.arange(len(seen))
    return ticks - np.maximum.accumulate(np.where(seen, ticks, -1))


def _mean_share(attacks: Seen, succeed: Seen) -> float | None:
    """Return the mean over places of the share of attacks that succeed; places without an attack do not count."""
    count = attacks.sum(axis=0)
    if not count.any():
        return None
    won = (attacks & succeed).sum(axis=0)
    return float((won[count > 0] / count[count > 0]).mean())
