"""Bodies on the way to a place: round closed ground, through a slanting slit, across a hall."""

import math

import numpy as np
import pytest

from agent.ports import Place, PolicyFailed, Stay
from agent.routes.ground import Disc
from agent.view import View
from patrol.ground.terrain import Terrain
from patrol.pose import MODELS, Command, Drive, Pose, Twist, Velocity
from patrol.radio.peers import Peer
from tests.agent.minds import STEP
from tests.agent.plans import POINT, Robots, Says, plan, prepared_in

HALL = plan((14.0, 8.0), (0.0, 0.0, 14.0, 8.0))


def robots_in_hall(model: str, start: Pose, place: Place, speed: float = 1.0) -> Robots:
    body = {"model": model, "radius": 0.3, "speed": speed, "turning_radius": 0.6}
    return Robots(prepared_in(HALL, [start], body), place)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("closes_at", [0.0, 2.4, 2.9, 3.4])
def test_what_closes_ahead_is_gone_round(model: str, closes_at: float) -> None:
    robots, disc = robots_in_hall(model, Pose(2.0, 4.05, 0.0), Place(12.0, 4.0)), (5.0, 4.0, 1.0)
    closed: list[Disc] = []
    robots.minds[0].body.obstacles = lambda *_: closed  # type: ignore[method-assign]
    for _ in range(60):
        robots.tick()
        if robots.bodies[0].pose.x > closes_at:
            closed = [disc]
        assert robots.apart(disc[:2]) >= disc[2] - 0.05
        if robots.apart((12.0, 4.0)) < 0.5:
            return
    pytest.fail(f"it is at {robots.bodies[0].pose}")


@pytest.mark.parametrize("low", [4.6, 4.9, 5.2])
def test_a_fast_holonomic_robot_cuts_across_nothing_closed(low: float) -> None:
    robots, disc = robots_in_hall("holonomic", Pose(2.0, low, 0.0), Place(12.0, 8.0 - low), 2.0), (7.0, 4.0, 1.5)
    robots.minds[0].body.obstacles = lambda *_: [disc]  # type: ignore[method-assign]
    for _ in range(30):
        robots.tick()
        assert robots.apart(disc[:2]) >= disc[2] - 0.05
    assert robots.apart((12.0, 8.0 - low)) < 0.1


# --- a slanting slit, where the way over the centres of points bends at each of them, and a hall ---------------------


SPEED = 1.0
SLANT = 0.6
"""Direction of the slit, rad."""


def slit(width: float) -> Terrain:
    """A slit of 12 m that joins two rooms, in the middle of 16 x 12 m."""
    rows, cols = np.mgrid[0:120, 0:160]
    x, y = (cols + 0.5) * POINT - 8.0, (rows + 0.5) * POINT - 6.0
    along, across = x * math.cos(SLANT) + y * math.sin(SLANT), y * math.cos(SLANT) - x * math.sin(SLANT)
    return Terrain("slit", (np.abs(along) > 6.0) | (np.abs(across) < 0.5 * width), POINT)


@pytest.mark.parametrize("model", ["holonomic", "differential", "car"])
@pytest.mark.parametrize("width", [0.88, 0.9, 1.0])
def test_it_drives_through_a_slit_without_a_stop_at_each_bend(model: str, width: float) -> None:
    across, up = 6.6 * math.cos(SLANT), 6.6 * math.sin(SLANT)
    start, end = (8.0 - across, 6.0 - up), (8.0 + across, 6.0 + up)
    body = {"model": model, "radius": 0.3, "speed": SPEED, "turning_radius": 0.6}
    robots = Robots(prepared_in(slit(width), [Pose(*start, SLANT)], body), Place(*end))
    robots.until_near(end, 0.15, round(1.1 * math.dist(start, end) / (SPEED * STEP)))
    assert robots.bodies[0].collisions == 0


@pytest.mark.parametrize("askew", [0.37, -0.5, 1.3])
def test_a_differential_robot_drives_straight_across_a_hall(askew: float) -> None:
    start, end, speed = (1.0, 2.0), (15.0, 9.0), 0.35
    bearing = math.atan2(end[1] - start[1], end[0] - start[0])
    hall = Terrain("hall", np.ones((120, 160), dtype=np.bool_), POINT)
    body = {"model": "differential", "radius": 0.3, "speed": speed}
    robots = Robots(prepared_in(hall, [Pose(*start, bearing + askew)], body), Place(*end))
    needs_s = math.dist(start, end) / speed + abs(askew) * 0.3 / speed
    robots.until_near(end, 0.15, round(1.03 * needs_s / STEP))


# --- a step and other robots' places that come with a place ----------------------------------------------------------


COMMANDS: dict[str, Command] = {
    "holonomic": Velocity(0.3, 0.4),
    "differential": Twist(0.4, 0.2),
    "car": Drive(-0.5, 0.3),
}


@pytest.mark.parametrize("model", MODELS)
def test_a_step_that_comes_with_a_place_is_taken(model: str) -> None:
    command = COMMANDS[model]
    robots = robots_in_hall(model, Pose(6.0, 4.0, 0.0), Place(12.0, 4.0, step=command, gives_room=True))
    (decision,) = robots.tick()
    assert decision.command.numbers == pytest.approx(command.numbers)


@pytest.mark.parametrize("model", MODELS)
def test_a_step_into_a_wall_is_not_taken_but_one_towards_the_place(model: str) -> None:
    into: dict[str, Command] = {
        "holonomic": Velocity(0.0, -1.0),
        "differential": Twist(-1.0, 0.0),
        "car": Drive(-1.0, 0.0),
    }
    place = Place(7.0, 6.0, step=into[model], gives_room=True)
    robots = robots_in_hall(model, Pose(7.0, 0.3, 0.5 * math.pi), place)
    robots.tick()
    assert robots.bodies[0].pose.y > 0.5
    assert robots.bodies[0].collisions == 0


@pytest.mark.parametrize("model", MODELS)
def test_a_step_into_another_robot_is_not_taken(model: str) -> None:
    commands: dict[str, Command] = {
        "holonomic": Velocity(1.0, 0.0),
        "differential": Twist(1.0, 0.0),
        "car": Drive(1.0, 0.0),
    }
    body = {"model": model, "radius": 0.3, "speed": 1.0, "turning_radius": 0.6}
    ready = prepared_in(HALL, [Pose(2.0, 4.0, 0.0), Pose(4.0, 4.0, 0.0)], body)
    robots = Robots(ready, Place(10.0, 4.0, step=commands[model], gives_room=True), Stay())
    for _ in range(30):
        robots.tick()
    assert [body.collisions for body in robots.bodies] == [0, 0]


@pytest.mark.parametrize("model", MODELS)
def test_others_are_where_the_policy_knows_them_to_be(model: str) -> None:
    """One that nobody hears stands in the way of a robot whose policy knows where."""
    body = {"model": model, "radius": 0.3, "speed": 1.0, "turning_radius": 0.6}
    ready = prepared_in(HALL, [Pose(2.0, 4.0, 0.0), Pose(6.0, 4.0, 0.0)], body)
    bumps = []
    for knows in (True, False):
        robots = Robots(ready, Stay(), Stay())
        robots.is_lost = lambda _k, _sender, _hearer: True

        def to_the_right(view: View, knows: bool = knows) -> Place:
            others = {2: Peer(view.tick, Pose(6.0, 4.0, 0.0), view.tick)} if knows else {}
            return Place(12.0, 4.0, gives_room=True, others=others)

        robots.minds[0].policy = Says(to_the_right)
        for _ in range(40):
            robots.tick()
        bumps.append(robots.bodies[0].collisions)
    assert bumps[0] == 0 < bumps[1]


def test_a_step_of_another_kind_is_a_failure_of_the_policy() -> None:
    robots = robots_in_hall("car", Pose(6.0, 4.0, 0.0), Place(12.0, 4.0, step=Twist(1.0, 0.0)))
    with pytest.raises(PolicyFailed, match=r"returned Place\(Twist\) for a car; give a Drive"):
        robots.tick()
