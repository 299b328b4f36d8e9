"""The turns between three stations in a row, 10 m apart, by a body of 0.5 m: a turn by 1 rad counts as 0.5 m."""

import math

import numpy as np
import pytest

from agent.policies.common_plan.turns import Turns
from patrol.ground.terrain import Terrain

TERRAIN = Terrain("row", np.ones((3, 60), dtype=np.bool_), 0.5)
SPOTS = np.array([60 + 5, 60 + 25, 60 + 45])
WAYS_M = 10.0 * abs(np.subtract.outer(np.arange(3.0), np.arange(3.0)))
HALF = 0.5 * math.pi


def turns(headings: list[float], angle: float = 0.0) -> Turns:
    return Turns(0.5, angle, TERRAIN, WAYS_M, SPOTS, np.array(headings))


def test_driving_on_costs_no_turn_and_back_costs_two() -> None:
    between_m = turns([0.0, 0.0, 0.0]).between_m
    assert between_m[0, 1] == between_m[1, 2] == between_m[0, 2] == 0.0
    assert between_m[1, 0] == between_m[2, 0] == pytest.approx(2.0 * HALF)
    assert (between_m.diagonal() == 0.0).all()


def test_a_look_aside_costs_a_turn_to_it_and_one_back() -> None:
    between_m = turns([0.0, HALF, 0.0]).between_m
    assert between_m[0, 1] == between_m[1, 2] == pytest.approx(0.5 * HALF)


def test_the_sensor_sees_beside_its_heading_so_less_of_a_turn_to_a_station_counts() -> None:
    between_m = turns([0.0, HALF, 0.0], angle=HALF).between_m
    assert between_m[0, 1] == pytest.approx(0.5 * 0.75 * HALF)
    assert between_m[1, 2] == pytest.approx(0.5 * HALF), "it has to drive ahead"


def test_any_heading_costs_nothing_and_two_looks_from_one_place_the_turn_between_them() -> None:
    assert turns([math.nan, math.nan, math.nan]).between_m.sum() == 0.0
    same = WAYS_M.copy()
    same[0, 1] = same[1, 0] = 0.0
    between_m = Turns(0.5, 0.0, TERRAIN, same, SPOTS[[0, 0, 2]], np.array([0.0, 1.0, 0.0])).between_m
    assert between_m[0, 1] == between_m[1, 0] == pytest.approx(0.5)


def test_from_a_pose_the_first_turn_is_from_its_heading() -> None:
    known, x = turns([0.0, 0.0, 0.0]), TERRAIN.centre(1, 5)[0]
    ahead = known.from_pose_m(np.array([x, 0.75, 0.0]), WAYS_M[0], 0.5)
    assert ahead.tolist() == pytest.approx([0.0, 0.0, 0.0])
    back = known.from_pose_m(np.array([x, 0.75, math.pi]), WAYS_M[0], 0.5)
    assert back.tolist() == pytest.approx([HALF, HALF, HALF])
