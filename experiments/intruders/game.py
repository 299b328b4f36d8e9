"""The infiltration game: how often a moving intruder that watches a patrol gets in unseen, and what watching gains it.

The paper's threat: "When the agents move over regular paths, it is very easy for an intruder to predict their movement
and plan the infiltration into the guarded object." In an *attempt* the intruder is outside at a random moment of the
second half of the run. It wants to get to a random target, unseen, and to stay there. It knows all that was seen since
the run began, predicts what will be seen (`experiments.intruders.predictors`), and takes the way, and the time
to enter, on which it expects to be detected least. Then the way is tried against the run. The attempt succeeds if no
robot sees the intruder from when it enters until its stay is over.

It plans *once*, or *again* every second from what is then seen. The latter changes its way only for a much better one
(`BETTER`), because of many forecasts the best looks better than it is. It may still enter later; once its stay has
begun, it stays.

The *gain of watching* is the success of the predictor that watches, less that of the blind intruder. All predictors
play the same attempts, so that the gain has an interval from pairs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.intruders.infiltrator import WATCHING, Infiltrator
from experiments.intruders.planner import DONE, OUTSIDE, Planner, Way, sightings
from experiments.intruders.predictors import Past, Predictor, predictors_of
from experiments.intruders.watch import Watch
from patrol.errors import BadInput
from patrol.random import Purpose, draw

WIDTH = 1.959964
"""Half the width of a 95 % interval, in standard deviations."""

AGAIN_S = 1.0
"""Time after which an intruder plans again, s."""

BETTER = 0.3
"""Expected sightings on a new way, as a share of those on the rest of the old one, below which it is taken."""

BLIND, CODE = "blind", "code"

Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Percent:
    """A share or a difference of shares with its 95 % interval, all in percent."""

    percent: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Gains:
    """The gains of knowledge, in percentage points over the blind intruder."""

    watching: Percent
    code: Percent | None = None  # None where it did not play


@dataclass(frozen=True, slots=True)
class Infiltration:
    """The outcome of the game."""

    attempts: int
    points: int  # how many points the intruder moves on
    point_m: float  # their distance
    speed: float  # of a straight move, m/s
    depth_m: float  # least length of the way from an entry to a target
    targets: int  # how many points were targets
    once: dict[str, Percent]  # success by predictor where the intruder plans once
    gain: Gains  # where the intruder plans once
    again: dict[str, Percent]  # success of watching, where it plans again every second; empty where not asked
    again_gain: Gains | None  # likewise; None where not asked


@dataclass(frozen=True, eq=False)
class Attempt:
    """An intruder's attempt to get to a target and stay there, unseen."""

    now: int  # the tick that was seen last when the intruder planned first
    target: int  # the point where it wants to stay
    way: Way  # from tick now + 1 on; to where it was seen, if it was
    seen: int | None  # the tick in which it was seen; None where it was not
    succeeded: bool  # whether its stay was over in time, unseen


class Game:
    """The game on one run."""

    def __init__(self, watch: Watch, infiltrator: Infiltrator) -> None:
        """Draw the attempts; raise BadInput where the run is too short, or there is no entry or no target."""
        seconds, depths_m = watch.ticks * watch.step, watch.ground.depths_m
        if seconds < infiltrator.least_s:
            needs = f"which watches and then plans over {infiltrator.within_s:g} s, needs {infiltrator.least_s:g} s"
            raise BadInput(f"the run has {seconds:g} s, and a moving intruder, {needs}; make a longer run")
        if not watch.ground.entries.any():
            where = {"edge": "edge of the patrolled ground", "doors": "doors between rooms"}
            entries = where.get(str(infiltrator.entries), "patrolled ground in the polygon")
            raise BadInput(f"a moving intruder finds no entry: there is no {entries}; choose other entries")
        self.watch = watch
        self.infiltrator = infiltrator
        self.depth_m = min(infiltrator.depth_m, 0.5 * float(depths_m[np.isfinite(depths_m)].max()))
        wanted = depths_m >= self.depth_m if watch.ground.wanted is None else watch.ground.wanted
        self.targets = np.flatnonzero(wanted & np.isfinite(depths_m) & watch.ever_seen())
        if not self.targets.size:
            raise BadInput(
                "a moving intruder finds no target that it can reach from an entry and that is seen now and then; "
                "choose another zone or other entries"
            )
        self.planner = Planner(watch.ground, watch.step, infiltrator.speed, infiltrator.stay_s)
        self.within = watch.ticks_of(infiltrator.within_s)  # ticks of an attempt
        self.past = Past(watch, self.within)
        self.predictors = predictors_of(self.past)  # by name; more can be added
        begin, end = watch.ticks // 2, watch.ticks - self.within
        self.trials = []  # tick and target of each attempt
        for number in range(infiltrator.attempts):
            moment, target = (draw(infiltrator.seed, Purpose.INFILTRATION, number, part) for part in range(2))
            self.trials.append(
                (begin + int(moment * (end - begin)), int(self.targets[int(target * len(self.targets))]))
            )

    def once(self, predictor: Predictor, now: int, target: int) -> Attempt:
        """Make an attempt that is planned once, when tick `now` was seen last."""
        way = self.planner.plan(predictor(now, self.within), OUTSIDE, target)
        return self._try_way(now, target, np.zeros(0, dtype=np.int32) if way is None else way)

    def again(self, predictor: Predictor, now: int, target: int) -> Attempt:
        """Make an attempt that is planned again every second, first when tick `now` was seen last."""
        every = self.watch.ticks_of(AGAIN_S)
        went: list[int] = []
        position, way = OUTSIDE, None
        while len(went) < self.within and not (went and self._is_seen(now + len(went), position)):
            if position == target:
                # It stays; a way that only passes its target would not have ended a second there.
                stayed = next((n for n, point in enumerate(reversed(went)) if point != target), len(went))
                went += [target] * min(self.planner.stay + 1 - stayed, self.within - len(went)) + [DONE]
                break
            remaining = self.within - len(went)
            chances = predictor(now + len(went), remaining)
            new_way = self.planner.plan(chances, position, target)
            if way is None or (new_way is not None and sightings(chances, new_way) < BETTER * sightings(chances, way)):
                way = new_way
            if way is None:
                break
            went += way[:every].tolist()
            position, way = went[-1], way[every:]
            if position == DONE:
                break
        return self._try_way(now, target, np.array(went, dtype=np.int32))

    def _try_way(self, now: int, target: int, way: Way) -> Attempt:
        """Try a way against the run."""
        stayed = 0
        for tick, point in enumerate(way.tolist(), start=now + 1):
            if point == DONE:
                break
            if self._is_seen(tick, point):
                return Attempt(now, target, way[: tick - now], tick, succeeded=False)
            stayed = stayed + 1 if point == target else 0
        # The stay begins when the intruder has come, at the end of a tick.
        return Attempt(now, target, way[way != DONE], None, stayed > self.planner.stay)

    def _is_seen(self, tick: int, point: int) -> bool:
        if point < 0:
            return False
        word, bit = divmod(point, 64)
        return bool(int(self.watch.words[tick, word]) >> bit & 1)


def infiltration(
    game: Game, again: bool = False, advance: Callable[[float], None] = lambda _share: None
) -> Infiltration:
    """Play all attempts with all predictors.

    With `again`, the one that watches also plans again every second, which takes minutes.
    """
    plans = [(name, game.once) for name in game.predictors]
    plans += [(WATCHING, game.again)] if again else []
    # A plan that is made again every second takes some forty times as long.
    work = [40.0 if play == game.again else 1.0 for _, play in plans]
    progress, total = 0.0, sum(work) * len(game.trials)
    won: list[Flags] = []
    for (name, play), weight in zip(plans, work, strict=True):
        outcomes = []
        for now, target in game.trials:
            outcomes.append(play(game.predictors[name], now, target).succeeded)
            progress += weight
            advance(progress / total)
        won.append(np.array(outcomes))
    once = dict(zip(game.predictors, won, strict=not again))
    later = {WATCHING: won[-1]} if again else {}
    return Infiltration(
        len(game.trials),
        game.watch.size,
        game.watch.ground.point_m,
        game.planner.straight_m_s,
        game.depth_m,
        len(game.targets),
        {name: share_of(outcomes) for name, outcomes in once.items()},
        _compute_gains(once, once[BLIND]),
        {name: share_of(outcomes) for name, outcomes in later.items()},
        _compute_gains(later, once[BLIND]) if later else None,
    )


def share_of(won: Flags | Sequence[bool]) -> Percent:
    """Return the share of attempts, at least one, that succeeded, with Wilson's interval."""
    n = len(won)
    share = float(np.mean(won))
    middle = (share + WIDTH**2 / (2 * n)) / (1.0 + WIDTH**2 / n)
    half = WIDTH / (1.0 + WIDTH**2 / n) * math.sqrt(share * (1.0 - share) / n + WIDTH**2 / (4 * n * n))
    return Percent(100.0 * share, 100.0 * max(middle - half, 0.0), 100.0 * min(middle + half, 1.0))


def gain_of(won: Flags, without: Flags) -> Percent:
    """Return how many more attempts succeed than the same ones `without` watching, with an interval from pairs.

    The interval is that of Agresti and Min 2005.
    """
    n = len(won)
    better, worse = int((won & ~without).sum()), int((without & ~won).sum())
    # Half a pair of each of the four kinds is added, so that few attempts that all agree do not look certain.
    middle = (better - worse) / (n + 2)
    half = WIDTH * math.sqrt(better + worse + 1.0 - (better - worse) ** 2 / (n + 2)) / (n + 2)
    return Percent(100.0 * (better - worse) / n, 100.0 * max(middle - half, -1.0), 100.0 * min(middle + half, 1.0))


def _compute_gains(won: dict[str, Flags], without: Flags) -> Gains:
    return Gains(**{name: gain_of(won[name], without) for name in (WATCHING, CODE) if name in won})
