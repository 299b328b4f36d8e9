"""Doors between rooms, at the limits of what counts as one."""

import numpy as np
import pytest

from patrol.ground.cspace import cspace_of, parts_of
from patrol.ground.doors import Door, Rooms
from patrol.ground.terrain import Terrain


def halls(point: float, wide_m: float, door_m: float, second_m: tuple[float, float] | None = None) -> Terrain:
    """A hall of `wide_m` x `wide_m`, a wall of one point with a door in its middle, and a second hall or room."""
    side, (long, high) = round(wide_m / point), second_m or (wide_m, wide_m)
    free = np.zeros((side, side + 1 + round(long / point)), dtype=np.bool_)
    free[:, :side] = True
    low = (side - round(high / point)) // 2
    free[low : low + round(high / point), side + 1 :] = True
    low = (side - round(door_m / point)) // 2
    free[low : low + round(door_m / point), side] = True
    return Terrain("halls", free, point)


def doors_of(terrain: Terrain, radius: float) -> list[Door]:
    """The doors for a body that starts in the first hall."""
    labels = parts_of(cspace_of(terrain, radius))[0]
    row, col = terrain.height // 2, terrain.height // 2
    return Rooms(terrain, radius, labels == labels[row, col]).doors()


@pytest.mark.parametrize(("door_m", "found"), [(10.0, True), (12.0, True), (20.0, False)])
def test_a_door_is_at_most_about_twelve_metres_wide(door_m: float, found: bool) -> None:
    terrain = halls(0.5, 40.0, door_m)
    doors = doors_of(terrain, 0.5)
    assert [door.width for door in doors] == ([pytest.approx(door_m, abs=0.51)] if found else [])
    if found:
        (door,) = doors
        assert door.passes
        assert door.behind == pytest.approx(1600.0, rel=0.02)
        assert (door.x, door.y) == pytest.approx((40.25, 20.0), abs=0.6)


@pytest.mark.parametrize(("high_m", "found"), [(1.0, False), (1.4, True)])
def test_only_doors_to_rooms_of_two_square_metres_are_listed(high_m: float, found: bool) -> None:
    """Behind the door lie 1.5 m by 1 m or by 1.4 m."""
    doors = doors_of(halls(0.1, 5.0, 0.6, (1.5, high_m)), 0.1)
    assert len(doors) == found
    assert all(door.behind == pytest.approx(1.5 * high_m, abs=0.1) for door in doors)


@pytest.mark.parametrize(("radius", "passes"), [(0.2, True), (0.21, False)])
def test_a_door_lets_the_widest_body_pass_and_no_wider_one(radius: float, passes: bool) -> None:
    """Five points of 0.1 m: a body keeps half a point more than its radius to both sides."""
    (door,) = doors_of(halls(0.1, 5.0, 0.5), radius)
    assert (door.width, door.radius) == pytest.approx((0.5, 0.2))
    assert door.passes == passes
    assert parts_of(cspace_of(halls(0.1, 5.0, 0.5), radius))[1] == (1 if passes else 2)
