"""The learned intruder: a neural network watches a patrol and attacks once, where and when it expects to stay unseen.

After "Time-Constrained Intelligent Adversaries" (Ward, Bott, York and Hunt, arXiv 2509.11971), not from its program.

In a *trial* an intruder that knows nothing begins to watch, at some time of the run, and has a horizon T. Once a second
it makes one step of training on four windows of its past, and one prediction. For each place it sees

- the idleness, divided by the attack's duration a: the time since the place was seen, or since it began to watch;
- nearness, the sum over robots of 1 / d, where d is the length of the robot's way to the place, in pixels;
- approach, the sum over robots of the speed towards the place, divided by d;

and from the past, whether the place then stayed unseen for a. It attacks once, not before T / 2, as soon as

- some output is at least 0.5: the place is that with the greatest, and
- it is *armed*: with p, the share of its predictions so far of which some output was at least 0.5, another such moment
  before 0.9 T - a is not almost sure, 1 - (1 - p)^(0.9 T - a - t) < 0.999.

The attack must be over within the horizon. It succeeds where no robot sees the place in the ticks t + 1 to t + a, as
for the other intruders. A trial without an attack is a failure.

    ticks    s         s + T / 2              s + T - 1
             |  watches    |  may attack  |  a  |
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.intruders.network import FEATURES, WINDOW, Floats, Networks, drawn_weights
from experiments.intruders.standing import Seen, Ticks, attack_ticks, unseen_after, unseen_since
from patrol.errors import BadInput
from patrol.kernels.elementary import power
from patrol.random import Purpose, draw

BATCH = 4
"""Windows of the past in one step of training."""

CONFIDENT = 0.5
"""Least output that counts as a chance to attack."""

SURE = 0.999
"""Chance of another moment to attack from which on the intruder waits."""

WATCHED = 0.5
"""Share of the horizon in which it only watches."""

IN_TIME = 0.9
"""Share of the horizon by which it wants to be done."""

BALANCE = 0.25
"""Share of the imbalance between places that are seen and those that stay unseen which the loss makes up for."""

AT_ONCE = 1 << 18
"""Weights of the networks that are trained at once, so that they stay in the processor's cache."""

BATCHES = 99
"""Third argument of the draws of batches, where those of weights have their layer."""

Features = NDArray[np.float32]
Advance = Callable[[float], None]
"""Called with the share of the work that is done."""


@dataclass(frozen=True, eq=False)
class Watched:
    """A patrol as an intruder sees it; arrays are (ticks, places)."""

    seen: Seen
    nearness: Features  # the sum over robots of 1 / distance, 1 / px
    approach: Features  # the sum over robots of speed towards the place / distance, 1 / s
    step: float  # length of a tick, s


@dataclass(frozen=True, slots=True)
class Trials:
    """The trials for each duration of an attack."""

    horizons_s: tuple[float, ...]
    number: int  # for each horizon; their starts are evenly spread over the run

    def check(self, ticks: int, step: float) -> None:
        """Refuse a run that is shorter than a horizon, and a horizon that is over before the first prediction."""
        needed = WINDOW * _second_ticks(step)
        for horizon_s in self.horizons_s:
            if round(horizon_s / step) < needed:
                raise BadInput(
                    f"horizon of {horizon_s:g} s: the intruder first watches for {needed * step:g} s; "
                    "choose a longer horizon"
                )
            if round(horizon_s / step) > ticks:
                raise BadInput(
                    f"horizon of {horizon_s:g} s: the run has only {ticks * step:g} s; "
                    "choose a shorter horizon or make a longer run"
                )


@dataclass(frozen=True, slots=True)
class Learned:
    """Outcome of the trials of one horizon and one duration of an attack.

    Both shares of trials are None where no attack that begins after half a horizon is over in time.
    """

    horizon_s: float
    attack_s: float
    success: float | None  # of trials whose attack succeeded
    attacked: float | None  # of trials with an attack


def learned_games(
    watched: Watched, attacks_s: Sequence[float], trials: Trials, advance: Advance = lambda _share: None
) -> list[Learned]:
    """Play trials on a run, after `Trials.check`, and return for each horizon the outcome for each duration."""
    trials.check(len(watched.seen), watched.step)
    free, since = unseen_after(watched.seen), unseen_since(watched.seen)
    games = [
        _Game(watched, free, since, horizon_s, attack_s) for horizon_s in trials.horizons_s for attack_s in attacks_s
    ]
    weights = drawn_weights(range(trials.number), watched.seen.shape[1])
    total = sum(game.work for game in games) * trials.number
    trained = 0

    def step(networks: int) -> None:
        nonlocal trained
        trained += networks
        advance(trained / total)

    return [game.play(weights, step) for game in games]


@dataclass(frozen=True, eq=False)
class _Game:
    """The trials of one horizon and one duration."""

    watched: Watched
    free: Ticks  # of `unseen_after`
    since: Ticks  # of `unseen_since`
    horizon_s: float
    attack_s: float

    @property
    def stride(self) -> int:
        """Ticks in a second; 1 where a tick is longer."""
        return _second_ticks(self.watched.step)

    @property
    def horizon(self) -> int:
        """Ticks of a trial."""
        return max(round(self.horizon_s / self.watched.step), 1)

    @property
    def attack(self) -> int:
        """Ticks of an attack."""
        return attack_ticks(self.attack_s, self.watched.step)

    @property
    def seconds(self) -> int:
        """Seconds of a trial."""
        return -(-self.horizon // self.stride)

    @property
    def work(self) -> int:
        """Number of predictions in a trial; 0 where no attack can be over in time."""
        return self.seconds - WINDOW + 1 if self._attack_times().any() else 0

    def _attack_times(self) -> Seen:
        """Return when an attack may begin, bool (seconds,)."""
        ticks = np.arange(self.seconds) * self.stride
        times = (ticks >= WATCHED * self.horizon) & (ticks + self.attack < self.horizon)
        times[: WINDOW - 1] = False
        return times

    def _seconds_left(self) -> NDArray[np.float64]:
        """Return how many seconds are left in each to begin an attack in time, (seconds,); negative when too late."""
        unit = self.stride * self.watched.step
        return (IN_TIME * self.horizon_s - self.attack_s) / unit - np.arange(self.seconds, dtype=np.float64)

    def play(self, weights: Sequence[Floats], step: Callable[[int], None]) -> Learned:
        """Play the trials from first weights; after each second `step` takes how many networks were trained."""
        if not self.work:
            return Learned(self.horizon_s, self.attack_s, None, None)
        trials = len(weights[0])
        starts = np.arange(trials) * (len(self.free) - self.horizon) // max(trials - 1, 1)
        places = self.free.shape[1]
        together = max(AT_ONCE // (places * places), 1)
        attacked = won = 0
        for first in range(0, trials, together):
            some = slice(first, first + together)
            begin = starts[some]
            best, targets = self._train_networks(
                begin, first, Networks([weight[some].copy() for weight in weights]), step
            )
            second = first_attack(best, self._attack_times(), self._seconds_left())
            attacks = np.flatnonzero(second >= 0)
            when = begin[attacks] + second[attacks] * self.stride
            attacked += attacks.size
            won += int((self.free[when, targets[attacks, second[attacks]]] >= self.attack).sum())
        return Learned(self.horizon_s, self.attack_s, won / trials, attacked / trials)

    def _train_networks(
        self, begin: NDArray[np.int64], seed: int, networks: Networks, step: Callable[[int], None]
    ) -> tuple[Features, NDArray[np.int64]]:
        """Train networks second by second; return the greatest output in each and its place, (n, seconds)."""
        best = np.zeros((len(begin), self.seconds), dtype=np.float32)
        targets = np.zeros((len(begin), self.seconds), dtype=np.int64)
        unseen = np.zeros(len(begin))
        wait = -(-self.attack // self.stride)
        for second in range(WINDOW - 1, self.seconds):
            windows = second - wait - (WINDOW - 1) + 1
            if windows > 0:
                unseen += (self.free[begin + (second - wait) * self.stride] >= self.attack).sum(axis=1)
                ends = WINDOW - 1 + np.array([_draw_batch(seed + n, second, windows) for n in range(len(begin))])
                labels = self.free[begin[:, None] + ends * self.stride] >= self.attack
                ratio = windows * self.free.shape[1] / np.maximum(unseen, 1.0) - 1.0
                weight = (BALANCE * (ratio - 1.0) + 1.0).astype(np.float32)
                networks.train(self._cut_windows(begin, ends), labels, weight)
            outputs = networks.outputs(self._cut_windows(begin, np.full((len(begin), 1), second)))[:, 0]
            targets[:, second] = outputs.argmax(axis=1)
            best[:, second] = outputs.max(axis=1)
            step(len(begin))
        return best, targets

    def _cut_windows(self, begin: NDArray[np.int64], ends: NDArray[np.int64]) -> Features:
        """Return the windows that end at some seconds (n, b) of each trial, (n, 3, 10, b, V)."""
        since_begin = (ends[:, None, :] - np.arange(WINDOW - 1, -1, -1)[:, None]) * self.stride
        ticks = begin[:, None, None] + since_begin
        windows = np.empty((len(begin), FEATURES, *ticks.shape[1:], self.free.shape[1]), dtype=np.float32)
        idle = np.minimum(self.since[ticks], since_begin[..., None])
        np.multiply(idle, np.float32(self.watched.step / self.attack_s), out=windows[:, 0], casting="same_kind")
        windows[:, 1] = self.watched.nearness[ticks]
        windows[:, 2] = self.watched.approach[ticks]
        return windows


def _second_ticks(step: float) -> int:
    """Return the ticks in a second; 1 where a tick is longer."""
    return max(round(1.0 / step), 1)


def first_attack(best: Features, times: Seen, left: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the second of each intruder's attack, its first chance when armed (see the module); -1 for none.

    `best` (n, seconds) holds the greatest output of each intruder in each second, 0 where it made no prediction.
    `times` (seconds,) says when an attack may begin, and `left` how many seconds are left in each to begin one in time.
    """
    chance = best >= CONFIDENT
    predictions = np.maximum(np.arange(best.shape[1]) - WINDOW + 2, 1)
    share = np.cumsum(chance, axis=1) / predictions
    armed = (left <= 0.0) | (1.0 - power(1.0 - share, np.maximum(left, 0.0)) < SURE)
    attacks = chance & armed & times
    return np.where(attacks.any(axis=1), attacks.argmax(axis=1), -1)


def _draw_batch(seed: int, second: int, known: int) -> list[int]:
    """Draw a batch from so many known windows of the past."""
    return [int(known * draw(seed, Purpose.INTRUDER, BATCHES, second, index)) for index in range(BATCH)]
