"""Visits: what a round that comes by some ground more often than once would take.

Ground with a wanted age may need to be seen more often than the rest. Its *visits* are put into a round over the other
ground: at some place the robots leave it, drive to the nearest place of a round over that ground, round it, and back.
Robots are evenly spaced, so what counts is where the visits lie within the length between two robots, its *lap*.

For example, two robots on a round of 160 m, that is, laps of 80 m. Two visits of 10 m make laps of 90 m. They are 45 m
apart within a lap if the second one lies 45 m or 135 m after the first, by the round with both.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from patrol.tours.round import Round

Lengths = NDArray[np.float64]

MOST_VISITS = 12
"""Visits in a round at most."""

MOST_CANDIDATES = 200
"""Places of a round at which a visit is tried, at most."""

SWEEPS = 2
"""Number of times that each visit is moved to where it is best, after each that is added."""


class Visit(NamedTuple):
    """A visit to some ground."""

    ground: int  # number of the ground
    place: int  # number of the round's place at which robots leave it
    length_m: float  # there, round the ground, and back; 0 where the round itself shows the ground


class Ground(NamedTuple):
    """Ground that is visited."""

    round: Round  # over it
    ways: NDArray[np.float32]  # (height, width), length of the way from each point to the nearest place of its round, m
    due_m: float  # length at most that a robot may drive from one visit to the next of any robot


def plan_visits(base: Round, grounds: Mapping[int, Ground], robots: int) -> tuple[Visit, ...]:
    """Choose visits for robots that are evenly spaced on a round, and return them in its order.

    They are chosen one after the other, for the ground that is most overdue, and moved to where they are best.
    """
    candidates = np.arange(0, len(base.places), math.ceil(len(base.places) / MOST_CANDIDATES))
    possible: dict[int, list[Visit]] = {}
    for number, ground in grounds.items():
        lengths = 2.0 * ground.ways.reshape(-1)[base.places[candidates]] + ground.round.length_m
        possible[number] = [Visit(number, *stop) for stop in zip(candidates.tolist(), lengths.tolist(), strict=True)]
    passed = {number: np.isin(base.points, ground.round.points) for number, ground in grounds.items()}
    fixed = [Visit(n, int(np.median(base.place_of[shown])), 0.0) for n, shown in passed.items() if shown.any()]

    def best(number: int, others: Sequence[Visit]) -> Visit:
        """Return the best visit to some ground, besides others."""
        tried = possible[number]
        return tried[int(_round_costs(base, grounds, robots, [[*others, visit] for visit in tried]).argmin())]

    visits: list[Visit] = []
    plans: list[tuple[float, tuple[Visit, ...]]] = []
    while len(visits) < MOST_VISITS:
        present = [*fixed, *visits]
        overdue = _overdue_factor(base, grounds, robots, [present])[0] if present else np.ones(len(grounds))
        if present and overdue.max() <= 1.0:
            break
        # All candidates are compared in one call: longest gaps are found for many plans at a time.
        visits.append(best(list(grounds)[int(overdue.argmax())], present))
        for _ in range(SWEEPS):
            # A copy, since the visits change while they are moved.
            for visit in list(visits):
                visits.remove(visit)
                visits.append(best(visit.ground, [*fixed, *visits]))
        plan = tuple(sorted([*fixed, *visits], key=lambda visit: visit.place))
        # A plan that leaves out some ground is none.
        if {visit.ground for visit in plan} == set(grounds):
            plans.append((float(_round_costs(base, grounds, robots, [plan])[0]), plan))
    return min(plans)[1]


def longest_gaps_m(base: Round, grounds: Iterable[int], robots: int, plans: Sequence[Sequence[Visit]]) -> Lengths:
    """Return the length (m) at most that a robot drives from one visit of some ground to the next of any robot.

    Shape (plans, grounds); infinity for ground without a visit. The base is without visits, and the robots are evenly
    spaced on the round with them. Plans have equally many visits each, at least one.
    """
    table = np.array(plans, dtype=np.float64)  # plans, visits, and the fields of a visit
    table = np.take_along_axis(table, table[:, :, 1].argsort(axis=1, kind="stable")[:, :, None], axis=1)
    number, stop, length_m = np.moveaxis(table, 2, 0)
    lap_m = ((base.length_m + length_m.sum(axis=1)) / robots)[:, None]
    middle_m = base.along[stop.astype(np.int64)] + length_m.cumsum(axis=1) - 0.5 * length_m
    gaps = []
    for ground in grounds:
        # Visits of all robots repeat with each lap, so only the place within a lap counts.
        visits_m = np.sort(np.where(number == ground, middle_m % lap_m, np.inf), axis=1)
        last = np.where(np.isfinite(visits_m), visits_m, -np.inf).max(axis=1)
        within = np.where(np.isfinite(last), last, 0.0)[:, None]  # infinity minus infinity is no number
        spread = np.diff(np.minimum(visits_m, within), axis=1).max(axis=1, initial=0.0)
        # From the last visit of a lap to the first of the next one, too.
        gaps.append(np.where(np.isfinite(last), np.maximum(spread, visits_m[:, 0] + lap_m[:, 0] - last), np.inf))
    return np.stack(gaps, axis=1)


def _overdue_factor(
    base: Round, grounds: Mapping[int, Ground], robots: int, plans: Sequence[Sequence[Visit]]
) -> Lengths:
    """Return how many times too long a robot drives between two visits of each ground, at least 1: (plans, grounds)."""
    due_m = np.array([ground.due_m for ground in grounds.values()])
    overdue: Lengths = np.maximum(longest_gaps_m(base, grounds, robots, plans) / due_m, 1.0)
    return overdue


def _round_costs(base: Round, grounds: Mapping[int, Ground], robots: int, plans: Sequence[Sequence[Visit]]) -> Lengths:
    """Return the length of the round with visits, times how many times too long it takes to the most overdue ground."""
    lengths = base.length_m + np.array([sum(visit.length_m for visit in plan) for plan in plans])
    overdue = _overdue_factor(base, grounds, robots, plans)
    costs: Lengths = lengths * np.where(np.isfinite(overdue), overdue, 1.0).max(axis=1)
    return costs
