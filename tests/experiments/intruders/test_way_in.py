"""The planned way against a plain search over points and ticks."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from experiments.intruders.ground import IntruderGround, ground_of
from experiments.intruders.planner import DONE, OUTSIDE, Planner
from tests.present import present

# Not the product's own, so that a wrong one there is noticed.
HASTE = 1e-4

TICKS, STAY = 9, 2


def plain_costs(chances: np.ndarray) -> np.ndarray:
    return np.array([[HASTE - math.log(1.0 - min(chance, 1.0 - 1e-6)) for chance in row] for row in chances.tolist()])


def least_cost(ground: IntruderGround, costs: np.ndarray, takes: tuple[int, int], start: int, goal: int) -> float:
    """The least cost of all ways: reached[j][v] after j ticks."""
    reached = np.full((TICKS + 1, len(ground.rows)), math.inf)
    if start != OUTSIDE:
        reached[0, start] = 0.0
    best = math.inf
    for j in range(1, TICKS - STAY + 1):
        for v in range(len(ground.rows)):
            ways = [reached[j - 1, v] + costs[j - 1, v]]
            if start == OUTSIDE and ground.entries[v]:
                ways.append(costs[j - 1, v])
            for u in range(len(ground.rows)):
                for k in np.flatnonzero(ground.neighbours[u] == v):
                    n = takes[int(k >= 4)]
                    if n <= j:
                        half = j - n + n // 2
                        ways.append(reached[j - n, u] + costs[j - n : half, u].sum() + costs[half:j, v].sum())
            reached[j, v] = min(ways)
        best = min(best, reached[j, goal] + costs[j : j + STAY, goal].sum())
    return best


@given(seed=st.integers(0, 2**32 - 1), speed=st.sampled_from([1.0, 2.0]), inside=st.booleans())
def test_no_way_costs_less(seed: int, speed: float, inside: bool) -> None:
    """On a small ground with walls, where robots are expected here and there."""
    dice = np.random.default_rng(seed)
    free = dice.random((4, 5)) < 0.8
    free[0, 0] = True
    ground = ground_of(free, 1.0)
    planner = Planner(ground, 0.5, speed, STAY * 0.5)
    size = len(ground.rows)
    chances = dice.choice([0.0, 0.0, 0.25, 0.5, 1.0], (TICKS, size)).astype(np.float32)
    start, goal = (int(dice.integers(size)) if inside else OUTSIDE), int(dice.integers(size))
    expected = least_cost(ground, plain_costs(chances), (1, 2) if speed == 2.0 else (2, 3), start, goal)
    way = planner.plan(chances, start, goal)
    if way is None:
        assert math.isinf(expected)
        return
    there = np.flatnonzero(way >= 0)
    assert there.tolist() == list(range(there[0], there[-1] + 1)), "it does not leave and come back"
    assert (way[: there[0]] == OUTSIDE).all()
    assert (way[there[-1] + 1 :] == DONE).all()
    assert (way[there[-STAY:]] == goal).all()
    assert np.isclose(plain_costs(chances)[there, way[there]].sum(), expected, rtol=1e-3)


def test_a_faster_intruder_makes_several_moves_in_a_tick() -> None:
    """A corridor of ten points: at 4 m/s it is passed in ten instants of a quarter of a second."""
    ground = ground_of(np.ones((1, 10), dtype=np.bool_), 1.0, np.arange(10)[None] == 0)
    way = present(Planner(ground, 0.5, 4.0, 0.5).plan(np.zeros((8, 10), dtype=np.float32), OUTSIDE, 9))
    assert way.tolist() == [1, 3, 5, 7, 9, 9, DONE, DONE]
