"""Commands become poses, and walls stop them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from patrol.ground.swept_path import advance, free_fraction, path_is_free
from patrol.ground.terrain import Terrain
from patrol.pose import Drive, Pose, Velocity


@pytest.fixture
def room() -> Terrain:
    """10 x 10 m of half-metre points; a wall over x in [6, 6.5) below y = 8, keep-out below y = 1."""
    passable = np.ones((20, 20), dtype=np.bool_)
    passable[:16, 12] = False
    keep_out = np.zeros_like(passable)
    keep_out[:2] = True
    return Terrain("room", passable, 0.5, (0.0, 0.0), keep_out)


def test_a_holonomic_robot_faces_the_way_it_moves() -> None:
    assert advance(Pose(1.0, 1.0, 0.3), Velocity(0.0, -2.0), 0.5) == Pose(1.0, 0.0, -math.pi / 2)
    assert advance(Pose(1.0, 1.0, 0.3), Velocity(0.0, 0.0), 0.5) == Pose(1.0, 1.0, 0.3)


def test_a_car_follows_its_arc() -> None:
    quarter = advance(Pose(0.0, 0.0, 0.0), Drive(math.pi, 0.5), 1.0)
    assert (quarter.x, quarter.y, quarter.heading) == pytest.approx((2.0, 2.0, math.pi / 2))
    back = advance(quarter, Drive(-math.pi, 0.5), 1.0)
    assert (back.x, back.y, back.heading) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    assert advance(quarter, Drive(0.0, 0.5), 1.0) == quarter


def test_walls_and_keep_out_stop_bodies(room: Terrain) -> None:
    here = Pose(5.0, 5.0, 0.0)
    assert path_is_free(room, here, Velocity(1.0, 0.0), 0.5, 0.5)
    assert not path_is_free(room, here, Velocity(1.1, 0.0), 0.5, 0.5)
    assert path_is_free(room, here, Drive(1.0, 0.0), 0.5, 0.5)
    assert not path_is_free(room, here, Drive(8.0, 0.0), 0.5, 0.5)
    assert not path_is_free(room, here, Velocity(0.0, -4.0), 1.0, 0.5)
    assert path_is_free(room, here, Velocity(0.0, 4.0), 1.0, 0.5)


def test_a_line_is_cut_where_it_touches(room: Terrain) -> None:
    assert free_fraction(room, Pose(5.0, 5.0, 0.0), Pose(7.0, 5.0, 0.0), 0.5) == pytest.approx(0.25)
    assert free_fraction(room, Pose(5.0, 9.0, 0.0), Pose(8.0, 9.0, 0.0), 0.5) == 1.0


@pytest.mark.parametrize("curvature", [1e-5, 1e-7, 1e-12, -1e-16, 5e-324])
@pytest.mark.parametrize("speed", [2.2, -2.2])
def test_an_arc_that_is_almost_a_line_is_stopped_by_what_stops_the_line(curvature: float, speed: float) -> None:
    passable = np.ones((100, 100), dtype=np.bool_)
    passable[40:60, 48:52] = False
    terrain = Terrain("block", passable, 0.5)
    here = Pose(25.0 - math.copysign(3.0, speed), 25.0, 0.0)
    assert not path_is_free(terrain, here, Drive(speed, 0.0), 1.0, 1.0)
    assert not path_is_free(terrain, here, Drive(speed, curvature), 1.0, 1.0)
    assert path_is_free(terrain, here, Drive(-speed, curvature), 1.0, 1.0)
