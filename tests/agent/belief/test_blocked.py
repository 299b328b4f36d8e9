"""A robot's belief in blocked ground."""

import numpy as np
import pytest

from agent.belief.blocked import Blocked
from agent.belief.posts import Posts
from patrol.changing.ground import ChangingFootprint
from patrol.exchange import MOST_BLOCKED, Sensed
from patrol.ground.fields import compute_fields
from patrol.ground.sensors import footprint_of
from patrol.ground.terrain import Terrain
from patrol.pose import Pose

MEMORY = 20
ROOM = np.ones((11, 30), dtype=np.bool_)
ROOM[:, 14] = False
ROOM[4:7, 14] = True  # a doorway of three points between two rooms
TERRAIN = Terrain("two rooms", ROOM, 1.0)
DOOR = tuple(row * 30 + 14 for row in (4, 5, 6))
BEFORE = Pose(5.5, 5.5, 0.0)
"""From here the robot sees the doorway."""


@pytest.fixture
def blocked() -> Blocked:
    """The belief of a robot in the left room, with a sensor of 10 m."""
    footprint = ChangingFootprint(lambda ground: footprint_of(ground, 10.0), TERRAIN)
    return Blocked(footprint, compute_fields(TERRAIN, 0.4, 10.0, True, [BEFORE]), 0.4, MEMORY)


def test_what_is_seen_blocked_is_left_out_with_all_behind_it(blocked: Blocked) -> None:
    blocked.sense(Sensed(0, BEFORE, blocked=DOOR))
    blocked.stand_at((5, 5))
    assert np.flatnonzero(blocked.grid).tolist() == list(DOOR)
    assert blocked.area is not None
    assert blocked.left_out is not None
    assert blocked.left_out[:, 15:].all()
    assert not blocked.left_out[:, 1:12].any()


@pytest.mark.parametrize("box", [DOOR, tuple(row * 30 + col for row in (4, 5, 6) for col in (8, 9, 10))])
def test_points_seen_free_are_forgotten_at_once_in_all_layers(box: tuple[int, ...], blocked: Blocked) -> None:
    blocked.sense(Sensed(0, BEFORE, blocked=box))
    blocked.sense(Sensed(1, BEFORE))
    assert not blocked.grid.any()
    assert blocked.area is None
    assert blocked.left_out is None


def test_a_closing_that_never_was_is_forgotten_when_the_memory_ends(blocked: Blocked) -> None:
    """Such as another robot's body in a doorway that this one does not see again."""
    away = Pose(1.5, 1.5, 0.0)
    blocked.sense(Sensed(0, BEFORE, blocked=DOOR))
    blocked.sense(Sensed(MEMORY, away))
    assert blocked.grid.any()
    blocked.sense(Sensed(MEMORY + 1, away))
    assert not blocked.grid.any()
    assert blocked.area is None


def test_a_robot_that_is_shut_in_sees_its_own_side(blocked: Blocked) -> None:
    blocked.sense(Sensed(0, Pose(20.5, 5.5, 0.0), blocked=DOOR))
    blocked.stand_at((5, 20))
    assert blocked.left_out is not None
    assert blocked.left_out[:, 1:14][TERRAIN.passable[:, 1:14]].all()
    assert not blocked.left_out[:, 17:].any()


def test_new_places_to_stand_are_found_for_what_is_in_sight_past_a_box() -> None:
    footprint = ChangingFootprint(lambda ground: footprint_of(ground, 10.0), TERRAIN)
    fields = compute_fields(TERRAIN, 0.4, 10.0, True, [BEFORE])
    posts = Posts(fields.proxy)
    belief = Blocked(footprint, fields, 0.4, MEMORY, posts)
    usual = posts.rows.tolist()
    box = tuple(row * 30 + 14 for row in (5, 6))  # leaves a gap through which no body fits
    belief.sense(Sensed(0, BEFORE, blocked=box))
    belief.stand_at((5, 5))
    assert belief.left_out is not None
    assert belief.stands is not None
    assert not belief.left_out[4, 18]
    assert belief.left_out[9, 15]
    stand = divmod(int(belief.stands[4 * 30 + 18]), 30)
    assert stand[1] < 14
    assert [4, 18, *stand] in posts.rows.tolist()
    belief.sense(Sensed(1, BEFORE))
    assert posts.rows.tolist() == usual
    assert belief.stands is None


def test_indices_off_the_terrain_are_ignored(blocked: Blocked) -> None:
    blocked.sense(Sensed(0, BEFORE, blocked=(10**6,)))
    assert not blocked.grid.any()


@pytest.mark.parametrize(("reported", "stays"), [(MOST_BLOCKED - 1, False), (MOST_BLOCKED, True)])
def test_a_full_list_says_nothing_of_the_points_that_it_leaves_out(
    reported: int, stays: bool, blocked: Blocked
) -> None:
    box = tuple(row * 30 + col for row in (4, 5, 6) for col in (8, 9, 10))
    blocked.sense(Sensed(0, BEFORE, blocked=box))
    blocked.sense(Sensed(1, BEFORE, blocked=(DOOR * MOST_BLOCKED)[:reported]))
    assert blocked.grid.reshape(-1)[list(box)].any() == stays


def test_what_is_behind_a_wreck_is_left_out_while_it_is_believed_there() -> None:
    """On ground that never changes; the wreck stands in the doorway."""
    fields = compute_fields(TERRAIN, 0.4, 10.0, True, [BEFORE])
    posts = Posts(fields.proxy)
    blocked = Blocked(footprint_of(TERRAIN, 10.0), fields, 0.4, MEMORY, posts)
    blocked.sense(Sensed(0, BEFORE))
    blocked.stand_at((5, 5))
    assert blocked.left_out is None
    blocked.bar({(2, 30): (14.5, 5.5, 1.2)})
    blocked.stand_at((5, 5))
    assert blocked.left_out is not None
    assert blocked.left_out[0, 15]
    assert blocked.left_out[10, 15]
    assert not blocked.left_out[:, :14].any()
    assert not blocked.left_out[5, 15:20].any(), "in sight through the doorway"
    assert posts.stands[5, 17] % 30 < 14
    blocked.bar({})
    assert blocked.left_out is None
    assert posts.stands[5, 17] == 5 * 30 + 17


def test_posts_of_a_robots_own_move_alone() -> None:
    posts = Posts(compute_fields(TERRAIN, 0.4, 10.0, True, [BEFORE]).proxy)
    own, usual = posts.own(), posts.stands.copy()
    assert own.stands is posts.stands
    own.move(np.full(TERRAIN.shape, 7, dtype=np.int32))
    assert (own.stands == 7).all()
    assert np.array_equal(posts.stands, usual)


@pytest.mark.parametrize(("col", "side"), [(13, 15), (15, 13)])
def test_a_robot_right_beside_a_wreck_gets_out_on_its_side(col: int, side: int) -> None:
    """It stands where no centre may be, so what it sees from the other side is left out."""
    fields = compute_fields(TERRAIN, 0.4, 10.0, True, [BEFORE])
    blocked = Blocked(footprint_of(TERRAIN, 10.0), fields, 0.4, MEMORY, Posts(fields.proxy))
    blocked.bar({(2, 30): (14.5, 5.5, 1.6)})
    blocked.stand_at((5, col))
    assert blocked.left_out is not None
    assert blocked.left_out[0, side]
