"""On the way to a place, bodies go round ground that is closed, also where it closes while they drive."""

from __future__ import annotations

import pytest

from agent.ports import Place
from agent.routes.ground import Disc
from patrol.pose import MODELS, Pose
from tests.agent.plans import Robots, plan, prepared_in

HALL = plan((14.0, 8.0), (0.0, 0.0, 14.0, 8.0))


def robots_in_hall(model: str, start: Pose, place: Place, speed: float = 1.0) -> Robots:
    body = {"model": model, "radius": 0.3, "speed": speed, **({"turning_radius": 0.6} if model == "car" else {})}
    return Robots(prepared_in(HALL, [start], body), place)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("closes_at", [2.4, 2.9, 3.4])
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
