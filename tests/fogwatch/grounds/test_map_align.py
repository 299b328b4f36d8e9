"""The place of one map on another, by walls and by landmarks."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fogwatch.grounds import map_align
from fogwatch.grounds.map_align import Alignment, align_maps, fit_landmarks, only_alignment, wall_map
from patrol.errors import BadInput
from patrol.ground.terrain import Terrain
from patrol.maps.builtins import builtin_terrain
from patrol.pose import Pose
from ros2.wire.frames import composed, inverted

POINT = 0.5


def drawn(
    ground: Terrain, transform: Pose, *, reach: tuple[float, float] = (-math.inf, math.inf), noise: float = 0.0
) -> Terrain:
    """The map that a robot draws of a ground, in a frame of its own: what lies outside is not free.

    Args:
        ground: The ground.
        transform: Pose of the robot's frame on the ground.
        reach: The x on the ground from and to which it has seen anything.
        noise: Share of its points that it takes for the opposite.
    """
    xmin, ymin, xmax, ymax = ground.bounds
    corners = [composed(inverted(transform), Pose(x, y, 0.0)) for x in (xmin, xmax) for y in (ymin, ymax)]
    low = np.floor([min(one.x for one in corners) - 1.0, min(one.y for one in corners) - 1.0])
    high = np.ceil([max(one.x for one in corners) + 1.0, max(one.y for one in corners) + 1.0])
    width, height = (round(length / POINT) for length in high - low)
    cols, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    x, y = low[0] + cols * POINT, low[1] + rows * POINT
    cos, sin = math.cos(transform.heading), math.sin(transform.heading)
    gx, gy = transform.x + cos * x - sin * y, transform.y + sin * x + cos * y
    col, row = (np.floor(value / POINT).astype(int) for value in (gx - xmin, gy - ymin))
    inside = (col >= 0) & (col < ground.width) & (row >= 0) & (row < ground.height)
    free = inside & ground.passable[np.where(inside, row, 0), np.where(inside, col, 0)]
    free &= (gx >= reach[0]) & (gx <= reach[1])
    free ^= np.random.default_rng(7).random(free.shape) < noise
    return Terrain("drawn", free, POINT, (float(low[0]), float(low[1])))


def off(ground: Terrain, found: Pose, true: Pose) -> float:
    """The greatest distance between the corners of a ground by two transforms, m."""
    xmin, ymin, xmax, ymax = ground.bounds
    on_a = [composed(inverted(true), Pose(x, y, 0.0)) for x in (xmin, xmax) for y in (ymin, ymax)]
    pairs = [(composed(found, place), composed(true, place)) for place in on_a]
    return max(math.dist((one.x, one.y), (other.x, other.y)) for one, other in pairs)


@pytest.mark.parametrize(
    ("name", "transform", "share", "noise"),
    [
        ("clutter", Pose(3.0, -2.0, 2.0), 1.0, 0.0),
        ("clutter", Pose(-7.3, 11.2, -0.4), 0.6, 0.02),
        ("site", Pose(20.0, 5.0, math.pi), 1.0, 0.02),
        ("site", Pose(1.7, -4.1, -1.2), 0.6, 0.0),
    ],
)
def test_a_shifted_and_turned_map_is_found_within_a_point(
    name: str, transform: Pose, share: float, noise: float
) -> None:
    """Also if a robot has seen only a part of the ground, and one in fifty of its points is wrong."""
    ground = builtin_terrain(name, POINT)
    xmin, _, xmax, _ = ground.bounds
    own = drawn(ground, transform, reach=(xmin, xmin + share * (xmax - xmin)), noise=noise)
    found = align_maps(wall_map(own), wall_map(ground))
    assert off(ground, only_alignment(found).transform, transform) < POINT


def test_a_symmetric_map_is_refused() -> None:
    hall = np.zeros((40, 60), dtype=np.bool_)
    hall[2:-2, 2:-2] = True
    hall[18:22, 28:32] = False
    ground = Terrain("hall", hall, POINT)
    found = align_maps(wall_map(ground), wall_map(ground))
    with pytest.raises(BadInput, match=r"the maps lie on each other in 2 ways or more, .* give two --landmark"):
        only_alignment(found)


def test_maps_of_different_grounds_are_refused() -> None:
    found = align_maps(wall_map(builtin_terrain("clutter", POINT)), wall_map(builtin_terrain("yards", POINT)))
    with pytest.raises(BadInput):
        only_alignment(found)


def test_the_best_place_must_be_good_and_lead() -> None:
    here, there = Pose(0.0, 0.0, 0.0), Pose(1.0, 0.0, 3.1)
    assert only_alignment([Alignment(here, 0.9), Alignment(there, 0.75)]).transform == here
    with pytest.raises(BadInput, match=r"at best 45% of their walls agree"):
        only_alignment([Alignment(here, 0.45)])
    with pytest.raises(BadInput, match=r"in 2 ways or more, 0,0,0 with 90%; 1,0,3.1 with 85% of their walls"):
        only_alignment([Alignment(here, 0.9), Alignment(there, 0.85)])


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


def test_two_maps_that_have_only_a_part_in_common_are_laid_on_each_other() -> None:
    """Each shows seven tenths of the ground: the robot's the west, ours the east."""
    ground, transform = builtin_terrain("site", POINT), Pose(5.0, 7.0, 0.7)
    xmin, _, xmax, _ = ground.bounds
    third = 0.3 * (xmax - xmin)
    own = drawn(ground, transform, reach=(xmin, xmax - third))
    ours = drawn(ground, Pose(0.0, 0.0, 0.0), reach=(xmin + third, xmax))
    found = align_maps(wall_map(own), wall_map(ours))
    assert off(ground, only_alignment(found).transform, transform) < POINT
