"""Drawing by what is believed: robots that hear each other work out the same parts."""

from typing import Any

import pytest

from agent.chance import Chance
from agent.policies.common_plan.drawing import Part
from agent.policies.living import STUCK_S
from patrol.measures.best_tour import best_tour
from patrol.pose import Pose
from patrol.random import Purpose
from tests.agent.minds import STEP
from tests.agent.plans import Robots, plan, prepared_in
from tests.agent.policies.test_stochastic import BASE, STARTS, drawn_of, patrol
from tests.present import present


def parts_of(robots: Robots, robot: int = 0) -> dict[int, Part]:
    return drawn_of(robots, robot)._believed._fleet.parts.each


@pytest.mark.parametrize("policy", ["stochastic", "committed"])
@pytest.mark.parametrize("speeds", [(1.0, 1.0), (0.5, 1.5)])
def test_robots_that_hear_each_other_find_the_same_parts(speeds: tuple[float, float], policy: str) -> None:
    robots = Robots(patrol(speeds=speeds, policy=policy))
    for _ in range(300):
        robots.tick()
        routes = [[part.route for part in parts_of(robots, robot).values()] for robot in (0, 1)]
        assert routes[0] == routes[1]


def test_draws_stay_the_same_for_a_tenth_of_the_time_between_two_robots(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two robots at 1.25 m/s: on a tour of L m one passes after another in L / 1.25 / 2 s."""
    monkeypatch.setitem(BASE, "speed", 1.25)
    prepared, asked, real = patrol(), list[tuple[int, int]](), Chance.draw

    def draw(self: Chance, purpose: Purpose, *question: int) -> float:
        if purpose is Purpose.PLAN:
            asked.append((robots.k, question[0]))
        return real(self, purpose, *question)

    monkeypatch.setattr(Chance, "draw", draw)
    robots = Robots(prepared)
    for _ in range(200):
        robots.tick()
    spell_s = 0.1 * present(best_tour(prepared).length_m) / 1.25 / 2.0
    assert len({spell for _, spell in asked}) > 10
    assert {spell - int(tick * STEP / spell_s) for tick, spell in asked} == {0}


def test_a_robot_that_stands_still_is_left_out() -> None:
    robots = Robots(patrol())
    for tick in range(round(2 * STUCK_S / STEP)):
        robots.tick()
        robots.bodies[1].pose = STARTS[1]
        assert (2 in parts_of(robots)) == (tick * STEP <= STUCK_S), tick


def test_more_robots_than_stations_go_on() -> None:
    """Spare robots that have come to a small ground."""
    rooms = plan((9.0, 6.0), (0.0, 0.0, 4.0, 6.0), (4.0, 2.0, 5.0, 4.0), (5.0, 0.0, 9.0, 6.0))
    starts = [Pose(x, y, 0.0) for x in (1.0, 3.0, 6.0, 8.0) for y in (1.0, 5.0)]
    settings: dict[str, Any] = {"patrol": {"policy": "stochastic"}, "sensor": {"range": 2.5}}
    robots = Robots(prepared_in(rooms, starts, {"radius": 0.3, "speed": 1.0}, spares=len(starts) - 1, **settings))
    fewer = 0
    for _ in range(200):
        robots.tick()
        routes = [part.route for part in parts_of(robots).values()]
        stations = [station for route in routes for station in route]
        assert len(set(stations)) == len(stations), "a station is one robot's"
        fewer += [] in routes
    assert fewer > 0
    fog = robots.minds[0].belief.fog
    assert fog.seen == fog.points
