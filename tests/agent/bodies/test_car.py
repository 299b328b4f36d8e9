"""A car whose sensor looks ahead: it drives with its nose first, and turns to face what it is to see."""

import math

import pytest

from agent.bodies.car import ORIENTED
from agent.ports import Bearing, Place, State
from patrol.pose import Drive, Pose, wrap
from tests.agent.plans import POINT, Robots, Says, plan, prepared_in

HALL = plan((14.0, 8.0), (0.0, 0.0, 14.0, 8.0))


def car_in_hall(start: Pose, place: Place, angle: float) -> Robots:
    body = {"model": "car", "radius": 0.3, "speed": 1.0, "turning_radius": 0.6}
    return Robots(prepared_in(HALL, [start], body, sensor={"angle": angle}), place)


def drive_of(robots: Robots) -> Drive:
    command = robots.bodies[0].command
    assert isinstance(command, Drive)
    return command


@pytest.mark.parametrize("angle", [360.0, 90.0])
def test_it_reverses_far_only_if_it_sees_all_round(angle: float) -> None:
    alone = car_in_hall(Pose(11.0, 4.0, 0.0), Place(2.0, 4.0), angle)
    backwards_m = 0.0
    while alone.apart((2.0, 4.0)) > 1.0:
        here = alone.bodies[0].pose
        alone.tick()
        if drive_of(alone).speed < 0.0:
            backwards_m += math.dist((here.x, here.y), (alone.bodies[0].pose.x, alone.bodies[0].pose.y))
    assert (backwards_m > 6.0) is (angle == 360.0)
    assert backwards_m < 2.0 or angle == 360.0


@pytest.mark.parametrize("heading", [math.pi / 2, math.pi, -2.0])
@pytest.mark.parametrize("spot", [(7.0, 4.0), (12.0, 7.5), (13.5, 7.5)])
def test_it_ends_on_an_exact_place_and_faces_where_the_place_says(spot: tuple[float, float], heading: float) -> None:
    alone = car_in_hall(Pose(2.0, 4.0, 0.0), Place(*spot, exact=True, heading=heading), 90.0)
    states = {alone.tick()[0].state for _ in range(120)}
    assert alone.apart(spot) < 2.0 * POINT
    assert abs(wrap(heading - alone.bodies[0].pose.heading)) <= ORIENTED
    assert drive_of(alone).speed == 0.0
    assert states == {State.PATROLLING}


def test_it_turns_no_further_once_it_is_sent_elsewhere() -> None:
    spot = (7.0, 4.0)
    alone = car_in_hall(Pose(2.0, 4.0, 0.0), Place(*spot, exact=True, heading=math.pi), 90.0)
    alone.until(lambda: drive_of(alone).speed < 0.0, 60)
    alone.minds[0].policy = Says(Place(12.0, alone.bodies[0].pose.y, exact=True))
    alone.tick()
    assert drive_of(alone).speed > 0.0


def test_a_dead_end_in_which_it_does_not_turn_to_a_place_is_reported() -> None:
    narrow = plan((9.0, 1.0), (0.0, 0.1, 9.0, 0.9))
    body = {"model": "car", "radius": 0.3, "speed": 1.0, "turning_radius": 0.6}
    alone = Robots(prepared_in(narrow, [Pose(8.6, 0.5, 0.0)], body, sensor={"angle": 90.0}), Bearing((math.pi,)))
    states = [alone.tick()[0].state for _ in range(20)]
    assert states.count(State.DEAD_END) > 10


def test_it_steps_at_random_in_dead_ends_too_and_in_reverse_where_it_cannot_forward() -> None:
    narrow = plan((9.0, 1.0), (0.0, 0.1, 9.0, 0.9))
    body = {"model": "car", "radius": 0.3, "speed": 1.0, "turning_radius": 0.6}
    alone = Robots(prepared_in(narrow, [Pose(8.6, 0.5, 0.0)], body), Bearing((0.0,)))
    assert State.DEAD_END in {alone.tick()[0].state for _ in range(3)}
    alone.minds[0].policy = Says(Bearing((0.0,), wander=0.1))
    decision = alone.tick()[0]
    assert (decision.direction, decision.state) == (0.1, State.DEAD_END)
    for heading, forward in ((0.0, False), (math.pi, True)):
        alone = Robots(prepared_in(narrow, [Pose(8.6, 0.5, heading)], body), Bearing((0.0,), wander=heading))
        decision = alone.tick()[0]
        assert (drive_of(alone).speed > 0.0) is forward
        assert (decision.direction, decision.state) == (heading, State.PATROLLING)
