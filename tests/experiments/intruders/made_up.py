"""Patrols that are made up: robots that are somewhere in each tick, on open ground."""

import math

import numpy as np

from experiments.intruders.ground import ground_of
from experiments.intruders.watch import Watch, WatchLog
from patrol.ground.footprint import View


def watched(places: np.ndarray, side: int, range_m: float = 4.0, step: float = 0.5) -> Watch:
    """Watch robots on a square of open ground with points of 1 m.

    Args:
        places: float (ticks, robots, 2), x and y of each robot; NaN where it is not there.
        side: Of the ground, m.
        range_m: Of their sensor.
        step: Length of a tick, s.
    """
    reach = math.floor(range_m)
    across = np.arange(-reach, reach + 1)
    mask = (np.hypot(across[:, None], across) <= range_m).astype(np.uint8)
    log = WatchLog(ground_of(np.ones((side, side), dtype=np.bool_), 1.0), side, step, *places.shape[:2])
    for k, here in enumerate(places):
        there = [(robot, x, y) for robot, (x, y) in enumerate(here.tolist()) if not math.isnan(x)]
        log.look(k, [(r, (x, y), View(int(y) - reach, int(x) - reach, mask)) for r, x, y in there])
    return log.watch()


def ring(seconds: float, robots: int = 1) -> np.ndarray:
    """Robots at 2 m/s, a point a tick, evenly spaced on a round of 56 s: a square 6 m inside of one of 40 m."""
    along = (np.arange(round(2.0 * seconds))[:, None] + np.arange(robots) * 112.0 / robots) % 112.0
    place = np.clip(np.stack([along - 28.0 * n for n in range(4)]), 0.0, 28.0)
    return 6.0 + np.stack([place[0] - place[2], place[1] - place[3]], axis=2)


def wander() -> np.ndarray:
    """Two robots that wander for 450 s over a square of 12 m, one of which is not there at first."""
    dice = np.random.default_rng(7)
    places = (np.cumsum(dice.integers(-1, 2, (900, 2, 2)), axis=0) % 12).astype(np.float64)
    places[:260, 1] = np.nan
    return places
