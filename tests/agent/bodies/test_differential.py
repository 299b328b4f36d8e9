"""A body with two driven wheels in doors, corridors and corners, alone and face to face with another."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.bodies.differential import WheelSteering, smaller_turn
from agent.ports import Bearing, Place, State, Stay
from agent.routes.ground import Ground, Spot
from patrol.ground.fields import compute_fields
from patrol.ground.swept_path import advance, path_is_free
from patrol.ground.terrain import Terrain
from patrol.pose import Pose, Twist, wrap
from patrol.prepare import Prepared
from patrol.scenario import RobotSpec
from tests.agent.minds import STEP
from tests.agent.plans import POINT, Robots, Says, cluttered, plan, prepared_in
from tests.present import present

RADIUS, SPEED = 0.3, 1.0


def with_door(width: float) -> Terrain:
    """Two rooms of 4 x 6 m, and a door in a wall of 1 m between them."""
    return plan((9.0, 6.0), (0.0, 0.0, 4.0, 6.0), (5.0, 0.0, 9.0, 6.0), (4.0, 3.0, 5.0, 3.0 + width))


def prepared_for(terrain: Terrain, starts: Sequence[Pose], speed: float = SPEED, angle: float = 360.0) -> Prepared:
    robots = {"model": "differential", "radius": RADIUS, "speed": speed}
    patrol = {"goal_distance": 1.65, "refine_side": 0.6, "refine_reach": 3.0}
    return prepared_in(terrain, starts, robots, patrol=patrol, sensor={"angle": angle})


@pytest.mark.parametrize("heading", [0.0, 2.0, math.pi, -1.0])
def test_it_passes_a_door_two_points_wider_than_itself(heading: float) -> None:
    terrain = with_door(2.0 * RADIUS + 2.0 * POINT)
    alone = Robots(prepared_for(terrain, [Pose(1.0, 1.0, heading)]), Place(8.0, 5.0))
    alone.until(lambda: alone.apart((8.0, 5.0)) < 0.01, 60)
    for _ in range(5):
        assert alone.tick()[0].state == State.PATROLLING
        assert alone.apart((8.0, 5.0)) < 0.01
        assert alone.bodies[0].command == Twist(0.0, 0.0)
    assert alone.bodies[0].collisions == 0


@pytest.mark.parametrize("angle", [360.0, 90.0])
def test_it_reverses_to_a_place_behind_it_only_if_it_sees_all_round(angle: float) -> None:
    terrain = plan((9.0, 1.0), (0.0, 0.0, 9.0, 1.0))
    alone = Robots(prepared_for(terrain, [Pose(8.0, 0.5, 0.1)], angle=angle), Place(1.0, 0.5))
    alone.until(lambda: alone.apart((1.0, 0.5)) < 0.01, 60)
    assert (abs(alone.bodies[0].pose.heading) < 0.5 * math.pi) is (angle == 360.0)


@pytest.mark.parametrize("heading", [0.0, math.pi / 2, 3.0])
def test_it_turns_about_at_the_end_of_a_corridor(heading: float) -> None:
    """A corridor one point wider than the body on each side, with the robot at its closed end."""
    terrain = plan((9.0, 4.0), (0.0, 0.0, 3.0, 4.0), (3.0, 1.0, 9.0, 1.8))
    alone = Robots(prepared_for(terrain, [Pose(8.6, 1.4, heading)]), Place(1.0, 3.0))
    states = set()
    for _ in range(40):
        states.add(alone.tick()[0].state)
    assert alone.apart((1.0, 3.0)) < 0.01
    assert states == {State.PATROLLING}


@pytest.mark.parametrize("speed", [0.1, 0.3, 3.0])
@pytest.mark.parametrize("spot", [(1.0, 1.3), (1.05, 0.95), (0.5, 1.0), (3.0, 5.0)])
def test_it_ends_near_its_place_at_any_speed_and_never_beyond_it(speed: float, spot: Spot) -> None:
    start = Pose(1.0, 1.0, 0.0)
    alone = Robots(prepared_for(with_door(2.0), [start], speed=speed), Place(*spot))
    nearest = alone.apart(spot)
    ticks = math.ceil((nearest / speed + 2.0 * math.pi * RADIUS / speed) / STEP) + 10
    for _ in range(ticks):
        alone.tick()
        assert alone.apart(spot) <= nearest + 0.15
        nearest = min(nearest, alone.apart(spot))
    assert alone.apart(spot) < 0.01
    assert alone.bodies[0].command == Twist(0.0, 0.0)


def test_a_policy_that_stays_is_obeyed_while_it_backs_off() -> None:
    terrain = plan((14.0, 1.0), (0.0, 0.1, 14.0, 0.9))
    starts = [Pose(6.0, 0.5, 0.0), Pose(8.0, 0.5, math.pi)]
    pair = Robots(prepared_for(terrain, starts), Bearing((0.0,)), Bearing((math.pi,)))
    for _ in range(8):
        pair.tick()
    for mind in pair.minds:
        mind.policy = Says(Stay())
    pair.tick()
    assert [body.command for body in pair.bodies] == [Twist(0.0, 0.0)] * 2


def test_who_fits_nowhere_but_where_it_stands_says_dead_end() -> None:
    terrain = plan((3.0, 3.0), (1.0, 1.0, 1.7, 1.7))
    alone = Robots(prepared_for(terrain, [Pose(1.35, 1.35, 0.0)]), Bearing((0.0, 1.5)))
    states = []
    for _ in range(40):
        states.append(alone.tick()[0].state)
        assert alone.apart((1.35, 1.35)) < 0.1  # there is room for 5 cm to each side
    assert states[0] == State.DEAD_END
    assert states.count(State.DEAD_END) > 20


def test_a_direction_that_it_turned_to_is_taken_even_if_another_becomes_stronger() -> None:
    alone = Robots(prepared_for(with_door(1.0), [Pose(2.0, 3.0, 0.0)]), Bearing((math.pi, 0.0)))
    (first,) = alone.tick()
    assert (first.direction, first.command.speed_mps) == (math.pi, 0.0)
    alone.minds[0].policy = Says(Bearing((0.0, math.pi)))
    directions = [alone.tick()[0].direction for _ in range(3)]
    assert directions[0] == math.pi
    assert alone.bodies[0].pose.x != 2.0
    assert directions[-1] == 0.0


# --- the steering alone ----------------------------------------------------------------------------------------------


@settings(max_examples=60)
@given(
    seed=st.integers(0, 10**6),
    body=st.tuples(st.floats(0.1, 6.0), st.floats(-math.pi, math.pi), st.floats(0.0, 0.999)),
    moves=st.lists(st.tuples(st.floats(0.0, 6.0), st.floats(0.0, 6.0), st.booleans()), min_size=1, max_size=25),
)
def test_whatever_it_steers_for_it_touches_no_wall_and_can_always_come_back(
    seed: int, body: tuple[float, float, float], moves: list[tuple[float, float, bool]]
) -> None:
    terrain, (speed, heading, share) = cluttered(seed, (60, 60), 12, POINT), body
    reach = compute_fields(terrain, RADIUS, 3.0, True, []).cspace
    places = np.argwhere(reach)
    if not len(places):
        return
    spec = RobotSpec(1, "r1", "differential", speed, RADIUS, 1.0, None)
    ground = Ground(terrain, reach)
    steering = WheelSteering(spec, terrain, ground, STEP)
    row, col = places[int(share * len(places))]
    pose = Pose(*terrain.centre(int(row), int(col)), heading)
    for x, y, wanders in moves:
        direction = math.atan2(y - pose.y, x - pose.x)
        twist = steering.turning(pose, direction) if wanders else steering.towards(pose, (x, y))
        assert twist.is_within(spec.limits)
        assert path_is_free(terrain, pose, twist, STEP, RADIUS)
        pose = advance(pose, twist, STEP)
        joined = present(ground.join(pose.x, pose.y))
        centre = ground.centre(*joined)
        least = min(math.dist((pose.x, pose.y), centre), steering.stride)
        assert steering.reach(pose, centre) == pytest.approx(least, abs=1e-5)


@given(heading=st.floats(-math.pi, math.pi), direction=st.floats(-10.0, 10.0))
def test_the_smaller_turn_is_at_most_a_quarter_and_leads_there(heading: float, direction: float) -> None:
    turn, sense = smaller_turn(heading, direction)
    assert abs(turn) <= math.pi / 2 + 1e-12
    driven = heading + turn + (math.pi if sense < 0.0 else 0.0)
    assert wrap(driven - direction) == pytest.approx(0.0, abs=1e-9)


def test_a_random_step_behind_the_body_is_driven_in_reverse() -> None:
    terrain = plan((9.0, 6.0), (0.0, 0.0, 9.0, 6.0))
    reach = compute_fields(terrain, RADIUS, 3.0, True, []).cspace
    steering = WheelSteering(
        RobotSpec(1, "r1", "differential", SPEED, RADIUS, 1.0, None), terrain, Ground(terrain, reach), STEP
    )
    pose = Pose(4.5, 3.0, 0.0)
    twist = steering.turning(pose, 3.0)
    # Turned by 3.0 - pi, its back looks that way; the wheels' speed that the turn leaves is driven backwards.
    turn = 3.0 - math.pi
    assert twist.turn_rate == pytest.approx(turn / STEP)
    assert twist.speed == pytest.approx(-(SPEED - abs(turn) / STEP * RADIUS))
    assert advance(pose, twist, STEP).x < pose.x
