"""The place of one map on another, by landmarks."""

import math

import numpy as np
import pytest

from fogwatch.grounds import map_align
from fogwatch.grounds.map_align import fit_landmarks, wall_map
from patrol.errors import BadInput
from patrol.ground.terrain import Terrain
from patrol.maps.builtins import builtin_terrain
from patrol.pose import Pose
from ros2.wire.frames import composed

POINT = 0.5


def test_walls_agree_where_maps_lie_right_and_hardly_elsewhere() -> None:
    walls = wall_map(builtin_terrain("clutter", POINT))
    assert map_align.agreement(walls, walls, Pose(0.0, 0.0, 0.0)) == 1.0
    assert map_align.agreement(walls, walls, Pose(3.0, 0.0, 0.0)) < 0.5


def test_landmarks_give_the_transform_and_how_far_each_is_off() -> None:
    true = Pose(10.0, 5.0, math.pi / 2)
    on_a = [(0.0, 0.0), (4.0, 0.0), (4.0, 3.0)]
    on_b = [(at.x, at.y) for at in (composed(true, Pose(x, y, 0.0)) for x, y in on_a)]
    pose, off_m = fit_landmarks(list(zip(on_a, on_b, strict=True)))
    assert (pose.x, pose.y, pose.heading) == pytest.approx((10.0, 5.0, math.pi / 2))
    assert off_m == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
    assert map_align.spelled(pose) == "10,5,1.5708"
    on_b[2] = on_b[2][0], on_b[2][1] + 1.2
    _, off_m = fit_landmarks(list(zip(on_a, on_b, strict=True)))
    assert max(off_m) == off_m[2] > 0.3


@pytest.mark.parametrize("pairs", [[((0.0, 0.0), (1.0, 1.0))], [((0.0, 0.0), (1.0, 1.0))] * 2])
def test_landmarks_that_say_nothing_of_the_turn_are_refused(
    pairs: list[tuple[tuple[float, float], tuple[float, float]]],
) -> None:
    with pytest.raises(BadInput, match=r"--landmark: .* far from each other"):
        fit_landmarks(pairs)


def test_a_ground_without_walls_is_refused() -> None:
    with pytest.raises(BadInput, match=r"shows 0 points of wall"):
        wall_map(Terrain("none", np.zeros((4, 4), dtype=np.bool_), POINT))
