from typing import Any

import numpy as np
import pytest

from patrol.ground.left_out import LeftOut
from patrol.ground.terrain import Terrain
from patrol.prepare import prepare
from patrol.scenario import load_scenario


def left_out(rooms: np.ndarray, **changes: Any) -> LeftOut | None:
    """Return what a robot of 0.2 m radius that starts at (1, 1) leaves out, on points of 0.1 m."""
    robots = {"count": 1, "model": "holonomic", "radius": 0.2, "starts": [[1.0, 1.0]]}
    scenario = load_scenario({"terrain": {"builtin": "open"}, "robots": robots, **changes})
    return prepare(scenario, Terrain("rooms", rooms, 0.1)).find_left_out()


def some_left_out(rooms: np.ndarray) -> LeftOut:
    left = left_out(rooms)
    assert left is not None
    return left


def three_rooms() -> np.ndarray:
    """Rooms of 3 x 3 m with walls of 0.2 m between them."""
    free = np.zeros((34, 98), dtype=np.bool_)
    for left in (2, 34, 66):
        free[2:32, left : left + 30] = True
    return free


def test_rooms_without_doors_are_left_out_with_their_area_place_and_reason() -> None:
    left = some_left_out(three_rooms())
    assert (left.area_m2, left.parts, left.largest_m2) == (18.0, 2, 9.0)
    assert (left.x, left.y) == pytest.approx((4.85, 1.65))
    assert left.text == (
        "18 m² of free ground in 2 parts, which no robot sees; the largest, 9 m², is around (4.85, 1.65), walled off, "
        "without an opening"
    )


def test_a_door_that_is_too_narrow_is_the_reason_and_with_a_wider_one_nothing_is_left_out() -> None:
    rooms = three_rooms()
    rooms[30:32, 32:66] = rooms[12:18, 64:66] = True  # a slit of 0.2 m into the second room, a door to the third
    left = some_left_out(rooms)
    assert left.parts == 1
    assert left.text.endswith("behind an opening that is too narrow for a body of radius 0.2 m")
    rooms[12:18, 32:34] = True
    assert left_out(rooms) is None


def test_closets_count_together_where_each_is_small_and_a_blind_corner_does_not() -> None:
    free = np.zeros((60, 120), dtype=np.bool_)
    free[2:58, 2:58] = True
    for closet in range(20):
        row, column = 2 + 11 * (closet // 4), 62 + 12 * (closet % 4)
        free[row : row + 8, column : column + 8] = True
    left = some_left_out(free)
    assert (left.area_m2, left.parts, left.small_parts, left.largest_m2) == (12.8, 20, 20, 0.64)
    assert left.text.startswith(
        "13 m² of free ground in 20 parts, each of less than 1 m², which no robot sees; the largest, 0.64 m², is"
    )
    free[2:58, 62:116] = True
    with_room = some_left_out(free)
    assert (with_room.parts, with_room.small_parts) == (1, 0)
    free[:, 62:] = False
    free[2:7, 62:67] = True  # 0.25 of 31.6 m2
    assert left_out(free) is None


def test_a_slit_that_takes_no_body_is_out_of_sight() -> None:
    free = np.zeros((50, 60), dtype=np.bool_)
    free[2:22, 2:22] = True
    free[20:22, 22:50] = free[22:50, 48:50] = free[48:50, 20:50] = True
    left = some_left_out(free)
    assert left.why == "too narrow for a body of radius 0.2 m"


def test_where_vertices_are_patrolled_they_count_and_no_ground_is_left_out() -> None:
    terrain = {"builtin": "open", "graph": {"vertices": [[1.0, 1.0], [2.0, 2.0]]}, "patrolled": "vertices"}
    assert left_out(three_rooms(), terrain=terrain) is None


def hall_with(*closets: tuple[int, int]) -> np.ndarray:
    """A hall of 9 x 9 m, and closets of so many rows and columns, walled off, on points of 0.1 m."""
    free = np.zeros((94, 200), dtype=np.bool_)
    free[2:92, 2:92] = True
    for number, (rows, columns) in enumerate(closets):
        top, left = 2 + 15 * (number // 4), 96 + 25 * (number % 4)
        free[top : top + rows, left : left + columns] = True
    return free


def test_a_part_counts_by_itself_from_one_square_metre_on() -> None:
    left = some_left_out(hall_with((10, 10), (9, 11)))
    # The second one is 0.99 m², above 1 % of the 82.99 m² that are free: small parts count together.
    assert (left.parts, left.small_parts, left.area_m2, left.largest_m2) == (2, 1, 1.99, 1.0)
    assert left.text.startswith("2 m² of free ground in 2 parts, 1 of them of less than 1 m², which no robot sees; the")
    alone = some_left_out(hall_with((10, 10), (5, 5)))  # 0.25 m² are below a hundredth
    assert (alone.parts, alone.small_parts, alone.area_m2) == (1, 0, 1.0)
    assert alone.text.startswith("1 m² of free ground, which no robot sees; it is around (")


def test_small_parts_count_together_from_a_hundredth_of_the_free_ground_on() -> None:
    """With 81 m² in the hall, a hundredth of all is 0.81 m² and a hundredth of the parts."""
    enough = hall_with((9, 9), (1, 1), (1, 1))
    free_m2 = np.count_nonzero(enough) / 100.0
    assert np.count_nonzero(enough) / 100.0 - 81.0 >= 0.01 * free_m2
    left = some_left_out(enough)
    assert (left.parts, left.small_parts, left.area_m2) == (3, 3, 0.83)
    assert left_out(hall_with((9, 9))) is None
    assert "0.81 m², is around" in left.text
