"""The way back to the reachable points: from pockets and slits, and from nowhere else."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.ports import State, Stay
from agent.routes.ground import Ground
from agent.routes.way_back import WayBack
from patrol.ground.cspace import cspace_of
from patrol.ground.fields import compute_fields
from patrol.ground.swept_path import free_fraction
from patrol.ground.terrain import Terrain
from patrol.pose import MODELS, Pose
from tests.agent.plans import Robots, plan, prepared_in
from tests.present import present

# Not the product's own, so that a wrong one there is noticed.
REACH = 5.0

RADIUS = 0.3


def pocket(length: float) -> Terrain:
    """A room of 4 x 4 m, and a slit exactly as wide as the body that leads out of it."""
    return plan((5.0 + length, 4.0), (0.0, 0.0, 4.0, 4.0), (4.0, 2.0, 4.0 + length, 2.6))


def way_back(terrain: Terrain) -> WayBack:
    fields = compute_fields(terrain, RADIUS, 3.0, True, [Pose(2.0, 2.0, 0.0)])
    return WayBack(Ground(terrain, fields.reach), RADIUS)


def test_on_the_reachable_points_and_beside_them_none_is_needed() -> None:
    back = way_back(pocket(4.0))
    assert not back.is_needed(2.0, 2.0)
    assert not back.is_needed(3.85, 2.3)
    assert back.is_needed(5.0, 2.3)


def test_lengths_grow_into_the_pocket_up_to_a_limit() -> None:
    back = way_back(pocket(8.0))
    paths = present(back.paths(5.0, 2.3))
    assert paths.length_to(20, 20) == 0
    inside = [paths.length_to(23, col) for col in range(42, 80)]
    assert all(there - here == 100 for here, there in itertools.pairwise(inside))
    assert back.paths(4.0 + REACH + 0.5, 2.3) is None


@pytest.mark.parametrize("place", [(-3.0, 2.0), (500.0, 2.0), (4.5, 0.5)], ids=["outside", "far", "wall"])
def test_from_no_ground_at_all_no_way_leads_back(place: tuple[float, float]) -> None:
    back = way_back(pocket(4.0))
    assert back.paths(*place) is None
    assert back.spot(*place) is None


def test_the_spot_is_reached_in_a_straight_line_and_is_nearer() -> None:
    back, terrain = way_back(pocket(4.0)), pocket(4.0)
    spot = present(back.spot(7.0, 2.3))
    assert free_fraction(terrain, Pose(7.0, 2.3, 0.0), Pose(*spot, 0.0), RADIUS) >= 1.0
    assert spot[0] < 4.0


def test_where_no_centre_of_a_point_is_free_the_way_that_it_came_is_taken() -> None:
    """The slit's middle lies on no centre of a point."""
    terrain = plan((9.0, 4.0), (0.0, 0.0, 4.0, 4.0), (4.0, 2.0, 8.0, 2.6))
    back = way_back(terrain)
    middle = 2.3
    for x in (3.5, 4.5, 5.5):
        back.note(x, middle)
    spot = present(back.spot(5.5, middle))
    assert spot[0] < 5.0


@settings(max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), data=st.data())
def test_wherever_a_body_fits_near_the_reachable_ground_a_way_is_known(seed: int, data: st.DataObject) -> None:
    """Every place that a body can reach by small steps from the ground, up to 3 m off it."""
    dice = np.random.default_rng(seed)
    passable = np.ones((60, 60), dtype=np.bool_)
    for _ in range(25):
        row, col = (int(place) for place in dice.integers(0, 58, 2))
        passable[row : row + int(dice.integers(1, 6)), col : col + int(dice.integers(1, 6))] = False
    passable[:12, :12] = True
    terrain = Terrain("clutter", passable, 0.1)
    reach = np.zeros_like(passable)
    reach[3:9, 3:9] = True
    back = WayBack(Ground(terrain, reach & cspace_of(terrain, RADIUS)), RADIUS)
    pose = Pose(0.6, 0.6, 0.0)
    for _ in range(25):
        bearing, step = data.draw(st.floats(0.0, 6.28)), 0.3
        there = Pose(pose.x + step * math.cos(bearing), pose.y + step * math.sin(bearing), 0.0)
        share = free_fraction(terrain, pose, there, RADIUS)
        pose = Pose(pose.x + share * (there.x - pose.x), pose.y + share * (there.y - pose.y), 0.0)
        if math.dist((pose.x, pose.y), (0.6, 0.6)) > 3.0:
            break
        assert back.paths(pose.x, pose.y) is not None


# --- bodies ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", MODELS)
def test_a_robot_that_patrols_comes_out_of_a_pocket(model: str) -> None:
    terrain = plan((8.0, 4.0), (0.0, 0.0, 4.0, 4.0), (4.0, 1.9, 7.0, 2.5))
    body = {"model": model, "radius": RADIUS, "speed": 1.0, "turning_radius": 0.8}
    prepared = prepared_in(terrain, [Pose(2.0, 2.0, 0.0)], body, sensor={"range": 2.0})
    robots = Robots(prepared, at_poses=[Pose(6.6, 2.2, 0.0)])
    states = []
    for _ in range(60):
        states.append(robots.tick()[0].state)
        if robots.bodies[0].pose.x < 3.5:
            break
    assert robots.bodies[0].pose.x < 3.5
    assert State.HOLDING not in states


@pytest.mark.parametrize("model", MODELS)
def test_who_is_told_to_stay_stays_off_the_ground_too(model: str) -> None:
    body = {"model": model, "radius": RADIUS, "speed": 1.0}
    prepared = prepared_in(pocket(4.0), [Pose(2.0, 2.0, 0.0)], body)
    robots = Robots(prepared, Stay(), at_poses=[Pose(6.0, 2.3, 0.0)])
    for _ in range(5):
        robots.tick()
    assert robots.bodies[0].pose == Pose(6.0, 2.3, 0.0)
