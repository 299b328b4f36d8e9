"""Psi against its formula, and the goal: clipped to the free ground and moved away from obstacles."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.bodies.base import GoalFinder
from agent.kernels.goal import refine
from agent.psi import psi_field
from agent.routes.ground import Ground
from patrol.ground.terrain import Terrain
from patrol.scenario import BodyLengths


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), reach_m=st.sampled_from([1.0, 2.0, 2.3]), point=st.sampled_from([0.5, 1.0]))
def test_psi_equals_its_formula(seed: int, reach_m: float, point: float) -> None:
    rng = np.random.default_rng(seed)
    height, width = (int(v) for v in rng.integers(2, 15, 2))
    passable = rng.random((height, width)) < 0.8
    passable[0, 0] = True
    psi = psi_field(Terrain("t", passable, point), reach_m)
    for row, col in np.argwhere(passable):
        expected = 0.0
        for dr in range(-20, 21):
            for dc in range(-20, 21):
                if abs(dr) * point >= reach_m or abs(dc) * point >= reach_m:
                    continue
                r, c = row + dr, col + dc
                inside = 0 <= r < height and 0 <= c < width
                if not inside or not passable[r, c]:
                    expected += 1.0 / (dr * dr + dc * dc)
        assert psi[row, col] == pytest.approx(expected, abs=1e-5)
    assert np.isinf(psi[~passable]).all()


def test_psi_is_exactly_zero_out_of_reach_of_obstacles() -> None:
    psi = psi_field(Terrain("t", np.ones((80, 90), dtype=np.bool_), 0.5), 10.0)
    assert (psi[25:55, 25:65] == 0.0).all()


def finder(passable: np.ndarray, refined: bool = True, **lengths_: float) -> GoalFinder:
    terrain = Terrain("t", passable, 0.5)
    lengths = replace(BodyLengths(), **lengths_)
    psi = psi_field(terrain, lengths.refine_reach)
    return GoalFinder(lengths, Ground(terrain, passable), psi if refined else None)


def test_on_open_ground_the_goal_lies_straight_ahead() -> None:
    goal = finder(np.ones((101, 101), dtype=np.bool_)).along(math.pi / 2, 51, 51)
    assert goal.goal == goal.refined == (25.25, 30.75)


def test_the_goal_is_the_last_free_point_of_the_ray() -> None:
    passable = np.ones((61, 61), dtype=np.bool_)
    passable[:, 35] = False
    goal = finder(passable, refined=False).along(0.0, 31, 31)
    assert goal.goal == goal.refined == (34.5 * 0.5, 30.5 * 0.5)


def test_refinement_takes_the_reachable_point_with_the_lowest_psi() -> None:
    passable = np.ones((61, 61), dtype=np.bool_)
    passable[:28, :] = False
    terrain = Terrain("t", passable, 0.5)
    psi = psi_field(terrain, 10.0)
    goal = finder(passable).along(0.0, 29, 21)
    row, col = terrain.point_at(*goal.goal)
    candidates = {(r, c): psi[r, c] for r in range(row - 2, row + 3) for c in range(col - 2, col + 3) if passable[r, c]}
    assert psi[terrain.point_at(*goal.refined)] == min(candidates.values())


def test_refinement_never_crosses_a_wall() -> None:
    passable = np.ones((61, 61), dtype=np.bool_)
    passable[30, :] = False
    passable[:24, :] = False
    # The corridor below the wall is narrow and the room above it wide: psi is lower beyond the wall.
    goal = finder(passable, refine_side=6.0).along(0.0, 28, 31)
    assert goal.refined[1] < 15.0
    assert goal.refined != goal.goal


@settings(max_examples=40)
@given(bearing=st.floats(-math.pi, math.pi), row=st.integers(2, 20), col=st.integers(2, 30))
def test_refinement_keeps_roughly_to_the_direction(bearing: float, row: int, col: int) -> None:
    passable = np.ones((22, 32), dtype=np.bool_)
    goals = finder(passable, refine_side=4.0)
    goal = goals.along(bearing, row, col)
    here = ((col - 0.5) * 0.5, (row - 0.5) * 0.5)
    if math.dist(goal.refined, here) > 1e-9 and goal.refined != goal.goal:
        off = math.remainder(math.atan2(goal.refined[1] - here[1], goal.refined[0] - here[0]) - bearing, 2 * math.pi)
        assert abs(off) <= math.pi / 4 + 1e-9


@settings(max_examples=100)
@given(
    seed=st.integers(0, 2**32 - 1),
    eighth=st.integers(0, 7),
    side=st.integers(0, 5),
    whole=st.booleans(),
    inside=st.booleans(),
)
def test_refinement_takes_the_lowest_the_nearest_and_then_the_first(
    seed: int, eighth: int, side: int, whole: bool, inside: bool
) -> None:
    """On open ground with few values of psi, so that many are equal, and with points at just 45 degrees."""
    dice = np.random.default_rng(seed)
    psi = dice.integers(0, 4, (14, 17)).astype(np.float32)
    goal, start = (tuple(int(dice.integers(1, 1 + most)) for most in psi.shape) for _ in range(2))
    if not inside:
        goal = (0, goal[1])
    bearing = eighth * math.pi / 4.0
    up, across = math.sin(bearing), math.cos(bearing)
    candidates = []
    for row, col in np.ndindex(psi.shape):
        gap = (row + 1 - goal[0], col + 1 - goal[1])
        ahead = (row + 1 - start[0], col + 1 - start[1])
        off = math.remainder(math.atan2(*ahead) - bearing, 2.0 * math.pi) if any(ahead) else 0.0
        if max(map(abs, gap)) <= side and (whole or abs(off) <= math.pi / 4.0 + 1e-9):
            candidates.append((psi[row, col], gap[0] ** 2 + gap[1] ** 2, (row + 1) * 19 + col + 1))
    at_goal = psi[goal[0] - 1, goal[1] - 1] if inside else math.inf
    better = [one for one in candidates if one[0] < at_goal and (inside or whole)]
    state = np.pad(np.ones(psi.shape, dtype=np.uint8), 1)
    shifted = start[0] + 0.5 - 1e-12 * up, start[1] + 0.5 - 1e-12 * across  # so that rounding leaves none out
    found = refine(state, psi, goal[0], goal[1], shifted[0], shifted[1], up, across, side, whole)
    assert found == min(better, default=(0, 0, -1))[2]
