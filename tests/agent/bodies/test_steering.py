"""Steering and the unstuck algorithm."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.bodies.car import AT_A_LOSS, HOPELESS_S, NEXT, ORIENTED, YIELDS, Event, Mode, Unstuck
from agent.bodies.steering import CarSteering, HolonomicSteering
from patrol.ground.swept_path import advance
from patrol.ground.terrain import Terrain
from patrol.pose import Drive, Pose, wrap
from patrol.random import Purpose, draw
from patrol.scenario import RobotSpec

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


def never(_tick: int, index: int) -> float:
    """Chance as long as nothing is left to it."""
    assert index == 1
    return 0.999


def escape(terrain: Terrain, pose: Pose, desired: float) -> tuple[int, Pose]:
    """Ticks until unstuck, and the pose then; fails when it takes more than a hundred."""
    steering = CarSteering(CAR, terrain, 0.5)
    unstuck = Unstuck(steering, CAR.speed, 0.5, never)
    unstuck.begin(0, desired)
    for tick in range(100):
        drive = unstuck.step(tick, pose, bumped=False)
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


def test_it_backs_further_each_time_it_gets_stuck_again_at_once() -> None:
    unstuck = Unstuck(CarSteering(CAR, FIELD, 0.5), CAR.speed, 0.5, never)
    backed = []
    tick = 0
    for _ in range(AT_A_LOSS - 1):
        pose = Pose(30.0, 30.0, 0.0)
        unstuck.begin(tick, 0.0)
        steps = 0
        while (drive := unstuck.step(tick, pose, bumped=False)) is not None:
            assert drive.speed < 0.0
            pose = advance(pose, drive, 0.5)
            steps += 1
            tick += 1
        unstuck.end(tick)
        backed.append(steps)
        assert unstuck.keeps_happening(tick) == (len(backed) > 1)
    assert backed == [1, 2, 3]
    assert not unstuck.keeps_happening(tick + 100)


def test_a_bump_while_backing_makes_it_drive_forward() -> None:
    unstuck = Unstuck(CarSteering(CAR, FIELD, 0.5), CAR.speed, 0.5, never)
    unstuck.begin(0, math.pi)
    pose = Pose(30.0, 30.0, 0.0)
    first = unstuck.step(0, pose, bumped=False)
    assert first is not None
    assert first.speed < 0.0
    second = unstuck.step(1, pose, bumped=True)
    assert second is not None
    assert second.speed > 0.0


def test_whoever_bumps_stands_still_now_and_then() -> None:
    says = [0.999]
    unstuck = Unstuck(CarSteering(CAR, FIELD, 0.5), CAR.speed, 0.5, lambda _tick, _index: says[0])
    unstuck.begin(0, math.pi)
    says[0] = YIELDS - 0.01
    assert unstuck.step(1, Pose(30.0, 30.0, 0.0), bumped=True) == Drive(0.0, 0.0)


def test_after_many_dead_ends_in_a_row_chance_says_where_to() -> None:
    asked: list[int] = []

    def chance(tick: int, _index: int) -> float:
        asked.append(tick)
        return 0.25  # of a turn

    unstuck = Unstuck(CarSteering(CAR, FIELD, 0.5), CAR.speed, 0.5, chance)
    tick = 0
    pose = Pose(30.0, 30.0, 0.0)
    for number in range(1, AT_A_LOSS + 1):
        assert not asked
        pose = Pose(30.0, 30.0, 0.0)
        unstuck.begin(tick, 0.0)
        while (drive := unstuck.step(tick, pose, bumped=False)) is not None:
            pose = advance(pose, drive, 0.5)
            tick += 1
        unstuck.end(tick)
        assert abs(wrap(pose.heading)) <= ORIENTED or number == AT_A_LOSS
    assert asked
    assert abs(wrap(math.pi / 2 - pose.heading)) <= ORIENTED


def test_in_a_dead_end_without_hope_chance_says_where_to() -> None:
    """Somebody else stands in the way of every move, so only another direction can be new."""
    unstuck = Unstuck(CarSteering(CAR, FIELD, 0.5), CAR.speed, 0.5, lambda _tick, index: 0.25 if index == 0 else 0.999)
    pose = Pose(30.0, 30.0, math.pi / 2)
    unstuck.begin(0, 0.0)
    last = round(HOPELESS_S / 0.5)
    for tick in range(last):
        assert unstuck.step(tick, pose, bumped=True) is not None
    assert unstuck.step(last, pose, bumped=True) is None  # it faces where chance points


def test_between_a_wall_and_a_wreck_short_steps_lead_out() -> None:
    """A full step ahead always ends in the wreck, of which steering knows nothing, and behind there is the wall."""
    unstuck = Unstuck(
        CarSteering(CAR, FIELD, 0.5), CAR.speed, 0.5, lambda tick, index: draw(1, Purpose.UNSTUCK, tick, index)
    )
    start, wreck = Pose(30.0, 1.1, math.pi / 2), (30.5, 4.5)
    pose, bumped = start, False
    unstuck.begin(0, 0.0)
    for tick in range(1000):
        drive = unstuck.step(tick, pose, bumped)
        if drive is None:
            unstuck.end(tick)
            unstuck.begin(tick, 0.0)
            continue
        ways = [advance(pose, drive, 0.5 * part / 8) for part in range(1, 9)]
        bumped = any(math.dist(wreck, (way.x, way.y)) < 2.0 * CAR.radius for way in ways)
        pose = pose if bumped else ways[-1]
        if math.dist((start.x, start.y), (pose.x, pose.y)) > 4.0:
            return
    raise AssertionError("it stays there for ever")


def test_from_each_mode_each_event_leads_to_one() -> None:
    assert set(NEXT) == set(Mode)
    assert all(set(row) == set(Event) for row in NEXT.values())
    assert {row[Event.BLOCKED] for row in NEXT.values()} == {Mode.RETREATING}
    assert {row[Event.OVER] for row in NEXT.values()} == {Mode.DRIVING}
    # A car that escapes or retreats does so until it is over, or until it bumps while it retreats.
    for mode in (Mode.ESCAPING, Mode.RETREATING):
        assert all(NEXT[mode][event] is mode for event in (Event.NEAR, Event.ARCS, Event.STUCK))
    assert NEXT[Mode.ESCAPING][Event.BUMPED] is Mode.ESCAPING
