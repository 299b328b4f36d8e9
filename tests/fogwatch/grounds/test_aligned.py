"""The agreement of two maps, and transforms by landmarks."""

import math

import numpy as np
import pytest

from fogwatch.grounds.map_align import WallMap, agreement, fit_landmarks, moved, spelled, wall_map
from patrol.errors import BadInput
from patrol.ground.terrain import Terrain
from patrol.pose import Pose


@pytest.mark.parametrize(
    ("pose", "text"),
    [
        (Pose(1.23456, -2.5, math.pi / 2), "1.2346,-2.5,1.5708"),
        (Pose(-0.00001, 0.0, -0.00004), "0,0,0"),
        (Pose(0.00005, 10.0, 3.14159265), "0.0001,10,3.1416"),
    ],
)
def test_a_pose_is_spelled_to_a_tenth_of_a_millimetre(pose: Pose, text: str) -> None:
    assert spelled(pose) == text


@pytest.mark.parametrize("heading", [0.0, 0.5, math.pi / 2, -2.0])
def test_places_are_turned_anticlockwise_and_then_shifted(heading: float) -> None:
    places = np.array([[1.0, 0.0], [0.0, 2.0], [3.0, -1.0]])
    expected = [
        (10.0 + x * math.cos(heading) - y * math.sin(heading), 5.0 + x * math.sin(heading) + y * math.cos(heading))
        for x, y in places.tolist()
    ]
    assert moved(places, Pose(10.0, 5.0, heading)) == pytest.approx(np.array(expected))


def test_landmarks_are_fitted_by_least_squares() -> None:
    """Two that are 4 m apart on one map and 5 m on the other are each half a metre off."""
    pose, off_m = fit_landmarks([((0.0, 0.0), (1.0, 2.0)), ((4.0, 0.0), (1.0, 7.0))])
    assert (pose.x, pose.y, pose.heading) == pytest.approx((1.0, 2.5, math.pi / 2))
    assert off_m == pytest.approx([0.5, 0.5])


def line(rows: int = 9, cols: int = 30, wall: int = 4) -> WallMap:
    """A wall of 30 points from left to right on known ground, in points of 0.5 m."""
    walls = np.zeros((rows, cols), dtype=np.bool_)
    walls[wall] = True
    return WallMap(walls, np.ones((rows, cols), dtype=np.bool_), 0.5, (2.0, 3.0))


@pytest.mark.parametrize(
    ("shift", "share"),
    [
        ((0.0, 0.0), 1.0),
        ((0.0, 0.5), 1.0),  # a point beside it agrees
        ((0.0, -0.5), 1.0),
        ((0.0, 1.0), 0.0),
        ((5.0, 0.0), (20 + 20) / (20 + 20)),  # 20 of 30 points are common, all of which agree
        ((7.5, 0.0), (15 + 15) / (18 + 18)),  # 15 are common, and count as 60 % of 30
        ((100.0, 0.0), 0.0),
    ],
)
def test_walls_agree_within_a_point_where_both_maps_are_known(shift: tuple[float, float], share: float) -> None:
    one = line()
    assert agreement(one, one, Pose(*shift, 0.0)) == pytest.approx(share)


@pytest.mark.parametrize(("length", "walls"), [(1, 8), (2, 10)])
def test_a_map_needs_ten_points_of_wall(length: int, walls: int) -> None:
    """A built-in corridor: all that lies around it is wall."""
    terrain = Terrain("corridor", np.ones((1, length), dtype=np.bool_), 0.5)
    if walls >= 10:
        found = wall_map(terrain)
        assert np.count_nonzero(found.walls) == walls
        assert found.origin == (-0.5, -0.5)
        assert found.places()[0].tolist() == [-0.25, -0.25]
    else:
        with pytest.raises(BadInput, match=r"corridor: shows 8 points of wall beside free ground; 10 are needed"):
            wall_map(terrain)
