"""Steering and the unstuck algorithm."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.bodies.car import Unstuck
from agent.bodies.steering import CarSteering, Footing, HolonomicSteering
from agent.build import Shared, build_mind
from agent.ports import Place
from agent.routes.ground import Ground
from patrol.ground.swept_path import advance
from patrol.ground.terrain import Terrain
from patrol.pose import MODELS, Drive, Pose, wrap
from patrol.prepare import Prepared, prepare
from patrol.scenario import RobotSpec, load_scenario
from tests.agent.minds import STEP, at
from tests.agent.plans import Says
from tests.present import present

# Not the product's own, so that a wrong one there is noticed.
ORIENTED = math.pi / 8

CAR = RobotSpec(1, "r1", "car", 4.4, 1.0, 3.5, None)
HOLONOMIC = RobotSpec(1, "r1", "holonomic", 4.4, 1.0, 3.5, None)
FIELD = Terrain("field", np.ones((120, 120), dtype=np.bool_), 0.5)
angles = st.floats(-math.pi, math.pi)


@settings(max_examples=60)
@given(heading=angles, x=st.floats(20, 40), y=st.floats(20, 40))
def test_a_car_turns_towards_its_target_and_never_tighter_than_it_can(heading: float, x: float, y: float) -> None:
    pose = Pose(30.0, 30.0, heading)
    drive = CarSteering(CAR, FIELD, 0.5).towards(pose, (x, y))
    assert drive.speed == 4.4
    assert abs(drive.curvature) <= 1 / 3.5
    bearing = math.atan2(y - 30.0, x - 30.0)
    after = advance(pose, drive, 0.5)
    assert abs(wrap(bearing - after.heading)) <= abs(wrap(bearing - heading)) + 1e-9


def test_a_car_that_needs_less_than_full_lock_ends_up_facing_its_target() -> None:
    pose = Pose(30.0, 30.0, 0.0)
    drive = CarSteering(CAR, FIELD, 0.5).turning(pose, 0.3, 4.4)
    assert advance(pose, drive, 0.5).heading == pytest.approx(0.3)
    backwards = CarSteering(CAR, FIELD, 0.5).turning(pose, 0.3, -4.4)
    assert advance(pose, backwards, 0.5).heading == pytest.approx(0.3)


def test_a_holonomic_robot_stops_at_its_target_and_before_walls() -> None:
    passable = np.ones((40, 60), dtype=np.bool_)
    passable[:, 40:] = False
    steering = HolonomicSteering(HOLONOMIC, Terrain("wall", passable, 0.5), 0.5)
    velocity, way = steering.towards(Pose(5.0, 10.0, 0.0), (6.0, 10.0))
    assert way == pytest.approx(1.0)
    assert velocity.vx == pytest.approx(2.0)
    velocity, way = steering.towards(Pose(18.0, 10.0, 0.0), (25.0, 10.0))
    assert way == pytest.approx(1.0, abs=1e-4)
    assert steering.towards(Pose(18.0, 10.0, 0.0), (18.0, 10.0)) == (type(velocity)(0.0, 0.0), 0.0)


def escape(terrain: Terrain, pose: Pose, desired: float) -> tuple[int, Pose]:
    """Ticks until unstuck, and the pose then; fails when it takes more than a hundred."""
    steering = CarSteering(CAR, terrain, 0.5)
    unstuck = Unstuck(steering, CAR.speed)
    unstuck.begin(desired)
    for tick in range(100):
        drive = unstuck.step(pose, bumped=False)
        if drive is None:
            return tick, pose
        assert steering.is_free(pose, drive) or drive == Drive(0.0, 0.0)
        pose = advance(pose, drive, 0.5)
    raise AssertionError("still stuck")


@settings(max_examples=40)
@given(desired=angles, heading=angles)
def test_on_open_ground_any_orientation_is_reached_by_backing(desired: float, heading: float) -> None:
    ticks, pose = escape(FIELD, Pose(30.0, 30.0, heading), desired)
    assert abs(wrap(desired - pose.heading)) <= ORIENTED
    assert 1 <= ticks <= 6


@settings(max_examples=40)
@given(desired=angles)
def test_a_car_gets_out_of_a_corner(desired: float) -> None:
    passable = np.zeros((120, 120), dtype=np.bool_)
    passable[40:100, 40:100] = True
    _, pose = escape(Terrain("yard", passable, 0.5), Pose(48.9, 48.9, math.pi / 4), desired)
    assert abs(wrap(desired - pose.heading)) <= ORIENTED


def test_a_bump_while_backing_makes_it_drive_forward() -> None:
    unstuck = Unstuck(CarSteering(CAR, FIELD, 0.5), CAR.speed)
    unstuck.begin(math.pi)
    pose = Pose(30.0, 30.0, 0.0)
    first = present(unstuck.step(pose, bumped=False))
    assert first.speed < 0.0
    second = present(unstuck.step(pose, bumped=True))
    assert second.speed > 0.0


# --- ground that a body fits on although no route leads there --------------------------------------------------------


ROOM = Pose(3.1, 4.3, 0.0)
SLIT = Pose(9.1, 4.3, 0.0)
"""A step from the slit's end; the room is behind."""


def slit() -> Terrain:
    """A room of 7 x 7 m, and a slit of 0.6 x 2.4 m off its right wall, in which a body of 0.56 m fits as it is."""
    passable = np.zeros((44, 54), dtype=np.bool_)
    passable[5:40, 5:40] = True
    passable[20:23, 40:52] = True
    return Terrain("slit", passable, 0.2)


def prepared_for(model: str) -> tuple[Prepared, Footing]:
    robots: dict[str, Any] = {"count": 1, "model": model, "radius": 0.28, "speed": 1.0, "turning_radius": 0.8}
    robots["starts"] = [[ROOM.x, ROOM.y]]
    prepared = prepare(load_scenario({"terrain": {"builtin": "open"}, "point": 0.2, "robots": robots}), slit())
    return prepared, Footing(prepared.terrain, Ground(prepared.terrain, prepared.fields[1].reach), 0.28)


def test_the_footing_ends_where_no_route_leads() -> None:
    _, there = prepared_for("holonomic")
    assert there.holds(ROOM.x, ROOM.y)
    assert not there.holds(SLIT.x, SLIT.y)
    assert not there.may_end(ROOM, SLIT.x, SLIT.y)
    assert there.may_end(SLIT, SLIT.x, SLIT.y)


@pytest.mark.parametrize("model", MODELS)
def test_no_random_step_leaves_the_ground(model: str) -> None:
    prepared, there = prepared_for(model)
    mouth = Pose(7.3, 4.3, 0.0)
    assert there.holds(mouth.x, mouth.y)
    while there.holds(mouth.x + 0.1, mouth.y):
        mouth = Pose(mouth.x + 0.1, mouth.y, 0.0)
    for share in range(-8, 9):
        aside = Place(ROOM.x, ROOM.y, wander=0.02 * share)
        mind = build_mind(Shared(prepared), 1)
        mind.policy = Says(aside)
        pose = mouth
        for k in range(3):
            pose = advance(pose, mind.step(at(k, pose), []).command, STEP)
            assert there.holds(pose.x, pose.y), f"{aside} leads to {pose}"
