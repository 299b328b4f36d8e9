"""Two robots that cannot get past each other: one of them goes back, and both come through."""

from __future__ import annotations

import pytest

from agent.ports import Place
from patrol.pose import Pose
from tests.agent.plans import Robots, plan, prepared_in
from tests.swaps import TEAMS, random_passage, swap

MOST_COLLISIONS = 25


@pytest.mark.parametrize("team", [team for team in TEAMS if "," not in team])
def test_two_robots_swap_rooms_through_a_corridor_in_which_they_cannot_pass(team: str) -> None:
    seed = next(seed for seed in range(100) if random_passage(seed, team).width < 1.25)
    result = swap(seed, team)
    assert result is not None
    assert result.passed, result
    # Robots that only push against each other collide many times before one is through by chance.
    assert result.collisions <= MOST_COLLISIONS, result


@pytest.mark.parametrize(("width", "gives_way"), [(1.0, False), (3.0, True)])
def test_a_robot_gives_way_only_where_a_way_leads_round_the_other(width: float, gives_way: bool) -> None:
    corridor = plan((12.0, 4.0), (0.0, 0.0, 3.0, 4.0), (3.0, 0.5, 9.0, 0.5 + width), (9.0, 0.0, 12.0, 4.0))
    middle = 0.5 + 0.5 * width
    starts = [Pose(4.0, middle, 0.0), Pose(8.0, middle, 0.0)]
    prepared = prepared_in(corridor, starts, {"radius": 0.3, "speed": 1.0, "model": "holonomic"})
    robots = Robots(prepared, Place(11.0, 2.0), Place(1.0, 2.0))
    given: list[tuple[int, object]] = []
    for number, mind in enumerate(robots.minds, 1):
        own = mind.body.obstacles

        def noted(*sensed: object, own: object = own, number: int = number) -> object:
            discs = own(*sensed)  # type: ignore[operator]
            given.extend((number, disc) for disc in discs)
            return discs

        mind.body.obstacles = noted  # type: ignore[method-assign, assignment]
    robots.until(lambda: all(body.bumped for body in robots.bodies), 20)
    robots.tick()
    # Robot 2 has the higher number.
    assert {number for number, _ in given} == ({2} if gives_way else set())
    robots.until(lambda: robots.apart((11.0, 2.0)) < 0.6 and robots.apart((1.0, 2.0), 1) < 0.6, 200)
