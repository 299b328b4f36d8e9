"""Intruder games: how often an intruder that watches a patrol stays at a place unseen for a whole attack.

Three intruders of the literature (Sak, Wainer and Goldenstein, "Probabilistic multiagent patrolling", SBIA 2008; Ward
and Hunt, "An empirical method for benchmarking multi-robot patrol strategies in adversarial environments", SAC 2023).
An attack that begins at tick t succeeds where no robot sees the place in the ticks t + 1 to t + a. One that would not
end before the run does is left out.

- *Random* attacks any place at any tick. Its share of successes is computed over all of them, not drawn.
- *Waiting* attacks as soon as the place has just been left.
- *Statistical* knows the times for which the place was unseen in the first half of the run. In the second half it
  attacks whenever the place has been unseen for the time after which, by the first half, success is most likely.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

ATTACKS_S = (25.0, 50.0, 75.0, 100.0, 125.0, 150.0)
"""Durations of attacks in the literature, s."""

SAMPLES = 5
"""Least number of times that a place was unseen by which the statistical intruder judges it; else by those of all.
Also the number of failures that it adds to those it knows."""

AT_ONCE = 128
"""Places that are played on at once, so that a long run takes little memory."""

ROUNDING = 1e-6
"""Rounding error of a number of ticks."""

Seen = NDArray[np.bool_]
"""bool (ticks, places): whether a robot saw (or visited) each place in each tick."""
Ticks = NDArray[np.int32]
"""int32 (ticks, places): numbers of ticks."""
Shares = NDArray[np.float64]
"""float64 (places,): NaN at places without an attack."""


@dataclass(frozen=True, slots=True)
class Successes:
    """Shares of attacks that succeed, each the mean over places; None where there was no attack."""

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
    """Play the games on a run, and return the shares for each duration of an attack."""
    half = len(seen) // 2
    stays = [unseen_times(seen[:half, column]) for column in range(seen.shape[1])]
    every = np.concatenate(stays) if stays else np.zeros(0, dtype=np.int64)
    usual_stays = [stay if len(stay) >= SAMPLES else every for stay in stays]
    durations = [attack_ticks(attack_s, step) for attack_s in attacks_s]
    shares = np.full((len(durations), 3, seen.shape[1]), np.nan)
    for first in range(0, seen.shape[1], AT_ONCE):
        places = slice(first, first + AT_ONCE)
        free, since = unseen_after(seen[:, places]), unseen_since(seen[:, places])
        for row, ticks in zip(shares, durations, strict=True):
            row[0, places] = _random_shares(free, ticks)
            row[1, places] = _waiting_shares(seen[:, places], free, ticks)
            row[2, places] = _statistical_shares(free, since, usual_stays[places], ticks)
    return [
        Successes(attack_s, *(_mean_share(values) for values in row))
        for attack_s, row in zip(attacks_s, shares, strict=True)
    ]


def attack_ticks(attack_s: float, step: float) -> int:
    """Return the least number of ticks that are not shorter than an attack."""
    return max(math.ceil(attack_s / step - ROUNDING), 1)


def unseen_after(seen: Seen) -> Ticks:
    """Return for how many ticks from the next one on each place stays unseen, to the run's end at most."""
    free = np.zeros(seen.shape, dtype=np.int32)
    for k in range(len(seen) - 2, -1, -1):
        free[k] = np.where(seen[k + 1], 0, free[k + 1] + 1)
    return free


def unseen_times(seen: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return for how many ticks each one place was unseen between two ticks in which it was seen."""
    gaps = np.diff(np.flatnonzero(seen)) - 1
    return gaps[gaps > 0]


def _random_shares(free: Ticks, ticks: int) -> Shares:
    began = free[: max(len(free) - ticks, 0)]
    return _success_shares(np.ones(began.shape, dtype=np.bool_), began >= ticks)


def _waiting_shares(seen: Seen, free: Ticks, ticks: int) -> Shares:
    last = max(len(seen) - ticks, 0)
    return _success_shares(seen[:last] & (free[:last] > 0), free[:last] >= ticks)


def _statistical_shares(free: Ticks, since: Ticks, known: Sequence[NDArray[np.int64]], ticks: int) -> Shares:
    begin, last = len(free) // 2, max(len(free) - ticks, 0)
    waits = np.array([best_wait(times, ticks) if len(times) else -1 for times in known])
    attacks = since[begin:last] == waits
    attacks &= (waits > 0) | (free[begin:last] > 0)
    return _success_shares(attacks, free[begin:last] >= ticks)


def best_wait(times: NDArray[np.int64], ticks: int) -> int:
    """Return after how many unseen ticks an attack is most likely to succeed; of equally good ones the least.

    `times` says for how many ticks the place was unseen each time, `ticks` how many an attack takes. Each wait is
    judged as if `SAMPLES` more attacks had failed, so that a few lucky ones do not outweigh many.
    """
    ordered = np.sort(times)
    waits = np.append(0, np.unique(ordered) + 1)
    reached = len(ordered) - np.searchsorted(ordered, waits)
    won = len(ordered) - np.searchsorted(ordered, waits + ticks)
    return int(waits[np.argmax(won / (reached + SAMPLES))])


def unseen_since(seen: Seen) -> Ticks:
    """Return for how many ticks each place has been unseen, this one included; 0 where it is seen.

    Before a place was seen, it counts from the run's beginning.
    """
    ticks = np.arange(len(seen), dtype=np.int32)[:, None]
    return ticks - np.maximum.accumulate(np.where(seen, ticks, np.int32(-1)), axis=0)


def _success_shares(attacks: Seen, succeed: Seen) -> Shares:
    """Return the share of attacks that succeed at each place."""
    count = attacks.sum(axis=0)
    won = (attacks & succeed).sum(axis=0)
    return np.where(count > 0, won / np.maximum(count, 1), np.nan)


def _mean_share(shares: Shares) -> float | None:
    """Return the mean over places with an attack; None without any."""
    valid = shares[~np.isnan(shares)]
    return float(valid.mean()) if valid.size else None
