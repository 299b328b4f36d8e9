"""Joint plans: every station stays in one route, no move makes a plan worse, and the chosen station comes first."""

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from agent.kernels.plan import compare, improve, oldest_ages, weighted_ages

Whole = NDArray[np.int64]
NOT_PINNED = np.zeros(8, dtype=np.bool_)


@dataclass(frozen=True)
class Fleet:
    """Robots and stations at random places of a square of 50 m, with random ages, which grow unlike fast."""

    leads: NDArray[np.float64]
    apart: NDArray[np.float64]
    paces: NDArray[np.float64]
    ages: NDArray[np.float64]
    rates: NDArray[np.float64]
    near: Whole

    @property
    def inputs(self) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any], Whole]:
        return self.leads, self.apart, self.paces, self.ages, self.rates, self.near

    def cost(self, routes: Whole, counts: Whole) -> float:
        """The cost of a plan, in plain Python."""
        total = 0.0
        for robot, count in enumerate(counts):
            at_s = 0.0
            for i, station in enumerate(routes[robot, :count]):
                before = routes[robot, i - 1]
                at_s = self.leads[robot, station] if i == 0 else at_s + self.apart[before, station] * self.paces[robot]
                total += float(self.ages[station] + self.rates[station] * at_s) ** 8
        return total


def fleet_of(dice: np.random.Generator, robots: int, stations: int) -> Fleet:
    spots, places = dice.random((stations, 2)) * 50.0, dice.random((robots, 2)) * 50.0
    apart = np.sqrt(((spots[:, None] - spots[None]) ** 2).sum(axis=2))
    leads = np.sqrt(((places[:, None] - spots[None]) ** 2).sum(axis=2))
    near = np.ascontiguousarray(np.argsort(apart, axis=1)[:, 1:9])
    ages = dice.uniform(0, 60, stations)
    paces = np.ones(1) if robots == 1 else dice.uniform(0.5, 2.0, robots)
    return Fleet(leads, apart, paces, ages, dice.choice([1.0, 4.0], stations), near)


def plan_of(dice: np.random.Generator, robots: int, stations: int) -> tuple[Whole, Whole]:
    routes = np.zeros((robots, stations), dtype=np.int64)
    parts = np.array_split(dice.permutation(stations), robots)
    for robot, part in enumerate(parts):
        routes[robot, : len(part)] = part
    return routes, np.array([len(part) for part in parts])


def stations_in(routes: Whole, counts: Whole) -> list[int]:
    return sorted(int(station) for row, count in zip(routes, counts, strict=True) for station in row[:count])


@settings(max_examples=200)
@given(seed=st.integers(0, 2**32 - 1), robots=st.integers(1, 4), stations=st.integers(5, 14), pins=st.booleans())
def test_moves_keep_stations_and_pins_and_never_cost_more(seed: int, robots: int, stations: int, pins: bool) -> None:
    dice = np.random.default_rng(seed)
    fleet = fleet_of(dice, robots, stations)
    routes, counts = plan_of(dice, robots, stations)
    pinned = dice.random(robots) < (0.5 if pins else 0.0)
    first, before = routes[:, 0].copy(), fleet.cost(routes, counts)
    improve(routes, counts, pinned, *fleet.inputs, 300, seed)
    assert stations_in(routes, counts) == list(range(stations))
    assert counts.min() >= 1
    assert fleet.cost(routes, counts) <= before * (1.0 + 1e-9)
    assert (routes[pinned, 0] == first[pinned]).all()


@given(seed=st.integers(0, 2**32 - 1), robots=st.integers(1, 4), stations=st.integers(5, 14))
def test_each_choice_comes_first_in_its_own_plan(seed: int, robots: int, stations: int) -> None:
    dice = np.random.default_rng(seed)
    fleet = fleet_of(dice, robots, stations)
    routes, counts = plan_of(dice, robots, stations)
    choices = np.sort(dice.permutation(stations)[:3])
    plans, plan_counts = np.zeros((3, robots, stations), dtype=np.int64), np.zeros((3, robots), dtype=np.int64)
    costs = np.zeros(3)
    compare(routes, counts, NOT_PINNED[:robots], 0, choices, *fleet.inputs, 200, seed, plans, plan_counts, costs)
    for choice, plan, plan_count, cost in zip(choices, plans, plan_counts, costs, strict=True):
        assert plan[0, 0] == choice
        assert stations_in(plan, plan_count) == list(range(stations))
        assert cost == pytest.approx(fleet.cost(plan, plan_count) ** (1 / 8))


def test_a_small_plan_is_nearly_the_best_of_all() -> None:
    """One robot and six stations: few of the 720 orders are better than what the moves find."""
    dice = np.random.default_rng(3)
    for _ in range(10):
        fleet = fleet_of(dice, 1, 6)
        routes, counts = plan_of(dice, 1, 6)
        improve(routes, counts, NOT_PINNED[:1], *fleet.inputs, 2000, 1)
        orders = (np.array([order]) for order in itertools.permutations(range(6)))
        best = min(fleet.cost(order, counts) for order in orders)
        assert fleet.cost(routes, counts) ** (1 / 8) <= 1.05 * best ** (1 / 8)


@given(st.integers(0, 2**32 - 1))
def test_the_oldest_points_of_stations_are_those_of_all_their_points_whatever_was_seen_between(seed: int) -> None:
    dice = np.random.default_rng(seed)
    shape = 3, 7
    points = dice.permutation(21)[:16]
    begins = np.array([0, 1, 5, 5 + int(dice.integers(1, 10)), 16])
    patrolled = dice.random(shape) < 0.7
    last_seen = dice.integers(-1, 3, shape).astype(np.int32)
    witnesses, ages = np.full((4, 2), -1, dtype=np.int64), np.full(4, np.nan)
    for tick in range(4, 30):
        oldest_ages(points, begins, patrolled, last_seen, tick, 0.5, witnesses, ages)
        each = np.empty(16)
        weighted_ages(points, patrolled, last_seen, np.zeros(0), tick, 0.5, each)
        assert ages.tolist() == np.maximum.reduceat(each, begins[:-1]).tolist()
        looked = np.where(dice.random(shape) < 0.2, np.int32(tick - dice.integers(0, 2)), np.int32(-1))
        np.maximum(last_seen, looked, out=last_seen)
