"""Places to wait: others get past a robot that stands there, through doors and along corridors."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from agent.routes.waiting import Waiting
from patrol.ground.fields import compute_fields
from patrol.kernels.clearance import label_parts
from patrol.pose import Pose
from tests.agent.plans import plan
from tests.present import present

# Not the product's own, so that a wrong one there is noticed.
KEEP_RADII = 3.5

RADIUS = 0.3
TERRAIN = plan((6.0, 8.2), (0.0, 0.0, 6.0, 4.0), (0.0, 4.2, 6.0, 8.2), (2.4, 4.0, 3.6, 4.2))
"""Two rooms of 6 x 4 m, one above the other; a door of 1.2 m joins them at x = 3 m."""
REACH = compute_fields(TERRAIN, RADIUS, 3.0, True, [Pose(1.0, 1.0, 0.0)]).reach
WAITING = Waiting(TERRAIN, REACH, RADIUS)
POINT = TERRAIN.point


def test_a_door_and_what_is_in_front_of_it_are_no_places_to_wait() -> None:
    for y in (3.5, 4.2, 5.0):
        assert not WAITING.lets_others_pass((3.05, y), ()), y


def test_a_corner_and_the_middle_of_a_wide_room_are() -> None:
    for spot in ((0.65, 0.65), (5.5, 7.8), (0.65, 3.5)):
        assert WAITING.lets_others_pass(spot, ()), spot


def test_where_no_centre_can_be_is_no_place_to_wait() -> None:
    assert not WAITING.lets_others_pass((0.05, 0.05), ())


def test_two_that_stand_close_together_are_in_each_others_way() -> None:
    assert not WAITING.lets_others_pass((0.65, 0.65), [(1.0, 0.65)])
    assert WAITING.lets_others_pass((0.65, 0.65), [(5.5, 0.65)])


def test_the_nearest_place_is_beside_the_door_and_keeps_clear_of_one_that_stands() -> None:
    rows, cols = np.mgrid[: TERRAIN.height, : TERRAIN.width]
    ways = (np.hypot(rows - 3.0 / POINT, cols - 3.0 / POINT) * POINT).astype(np.float32)
    among = REACH & (rows * POINT < 4.0) & (ways > 0.5)
    first = present(WAITING.nearest(ways, among, ()))
    assert WAITING.lets_others_pass(first, ())
    second = present(WAITING.nearest(ways, among, [first]))
    assert np.hypot(first[0] - second[0], first[1] - second[1]) > KEEP_RADII * RADIUS


def test_where_every_place_blocks_the_way_there_is_none() -> None:
    corridor = plan((8.0, 1.4), (0.0, 0.0, 8.0, 1.4))
    open_points = compute_fields(corridor, RADIUS, 3.0, True, [Pose(1.0, 0.7, 0.0)]).reach
    cols = np.mgrid[: corridor.height, : corridor.width][1]
    middle = open_points & (cols * corridor.point > 2.5) & (cols * corridor.point < 5.5)
    assert Waiting(corridor, open_points, RADIUS).nearest(cols.astype(np.float32), middle, ()) is None


@given(st.floats(0.6, 5.5), st.floats(0.6, 7.8))
def test_whoever_waits_where_others_pass_shuts_neither_room(x: float, y: float) -> None:
    row, col = TERRAIN.point_at(x, y)
    if not REACH[row, col] or not WAITING.lets_others_pass((x, y), ()):
        return
    rows, cols = np.mgrid[: TERRAIN.height, : TERRAIN.width]
    left = REACH & (np.hypot(rows - row, cols - col) * POINT > KEEP_RADII * RADIUS)
    parts = np.empty(left.shape, dtype=np.int32)
    label_parts(left.astype(np.uint8), parts, np.empty(left.size, dtype=np.int32))
    lower, upper = parts[rows * POINT < 4.0], parts[rows * POINT > 4.2]
    lower, upper = lower[lower > 0], upper[upper > 0]
    assert np.bincount(lower).argmax() == np.bincount(upper).argmax()
