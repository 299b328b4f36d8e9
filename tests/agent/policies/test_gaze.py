"""The gaze, on open ground: a sector of 90 degrees and 5 m in the middle of 20 x 20 m."""

import math

import numpy as np
import pytest

from agent.policies.gaze import look_from
from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import Terrain

TERRAIN = Terrain("open", np.ones((40, 40), dtype=np.bool_), 0.5)
SIGHT = footprint_of(TERRAIN, 5.0, 90.0)
MIDDLE = (10.25, 10.25)
BEHIND = (0, 0)
"""A point out of view."""


@pytest.mark.parametrize("direction", [0.0, math.pi / 2, -math.pi / 2, 2.4])
def test_it_looks_to_where_points_are_oldest(direction: float) -> None:
    last_seen = np.full((40, 40), 90, dtype=np.int32)
    x, y = MIDDLE[0] + 3.0 * math.cos(direction), MIDDLE[1] + 3.0 * math.sin(direction)
    row, col = TERRAIN.point_at(x, y)
    last_seen[row - 1 : row + 2, col - 1 : col + 2] = 0
    heading = look_from(SIGHT, MIDDLE, BEHIND, 100, np.ones((40, 40), dtype=np.bool_), last_seen)
    assert abs(math.remainder(heading - direction, math.tau)) < math.pi / 4


def test_points_that_do_not_count_draw_no_look() -> None:
    last_seen, counted = np.full((40, 40), 100, dtype=np.int32), np.ones((40, 40), dtype=np.bool_)
    last_seen[:, 25:] = 0
    counted[:, 25:] = False
    last_seen[:16] = 50
    heading = look_from(SIGHT, MIDDLE, BEHIND, 100, counted, last_seen)
    assert math.remainder(heading + math.pi / 2, math.tau) == pytest.approx(0.0, abs=math.pi / 4)


def test_a_target_in_view_comes_first() -> None:
    last_seen = np.full((40, 40), 100, dtype=np.int32)
    last_seen[:, 21:] = 0
    target = TERRAIN.point_at(7.0, 10.0)
    heading = look_from(SIGHT, MIDDLE, target, 100, np.ones((40, 40), dtype=np.bool_), last_seen)
    assert abs(math.remainder(heading - math.pi, math.tau)) < math.pi / 4
