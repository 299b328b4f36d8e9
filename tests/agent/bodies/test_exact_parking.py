"""A car that is asked for it goes onto the very point of a place; otherwise it parks as near as one step brings it."""

from __future__ import annotations

import pytest

from agent.ports import Place
from patrol.pose import Pose
from patrol.prepare import Prepared
from patrol.scenario import load_scenario
from tests.agent.bodies.test_bodies import Drives, walled
from tests.agent.minds import prepared_on

START = Pose(10.0, 5.0, 0.0)
SPOTS = [(12.25, 6.25), (9.75, 6.75), (6.25, 3.75), (10.25, 3.25)]
"""Centres of points beside a car, where no single step leads."""


@pytest.fixture(scope="module")
def prepared() -> Prepared:
    robots = {"count": 1, "model": "car"}
    return prepared_on(
        load_scenario({"terrain": {"builtin": "open"}, "point": 0.5, "robots": robots}), walled(), [START]
    )


@pytest.mark.parametrize("spot", SPOTS)
def test_it_ends_on_the_point_and_stays_there(spot: tuple[float, float], prepared: Prepared) -> None:
    drives = Drives(prepared, Place(*spot, exact=True), START)
    point = drives.terrain.point_at(*spot)
    for _ in range(80):
        drives.tick()
        if drives.terrain.point_at(drives.pose.x, drives.pose.y) == point:
            break
    else:
        pytest.fail(f"it is at {drives.pose}")
    for _ in range(5):
        drives.tick()
        assert drives.terrain.point_at(drives.pose.x, drives.pose.y) == point


def test_without_being_asked_it_stays_beside_some_of_them(prepared: Prepared) -> None:
    beside = 0
    for spot in SPOTS:
        drives = Drives(prepared, Place(*spot), START)
        for _ in range(80):
            drives.tick()
        beside += drives.terrain.point_at(drives.pose.x, drives.pose.y) != drives.terrain.point_at(*spot)
    assert beside > 0
