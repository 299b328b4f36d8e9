"""A car that is asked for it goes onto the very point of a place; otherwise it parks as near as one step brings it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.ports import Place
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.prepare import Prepared
from patrol.radio.message import as_received
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


@pytest.fixture(scope="module")
def fine() -> Prepared:
    """Points of 0.1 m, without walls."""
    robots = {"count": 1, "model": "car"}
    scenario = load_scenario({"terrain": {"builtin": "open"}, "point": 0.1, "robots": robots})
    return prepared_on(scenario, Terrain("free", np.ones((125, 170), dtype=np.bool_), 0.1), [START])


@pytest.mark.parametrize("spot", SPOTS)
def test_it_ends_on_the_point_and_stays_there(spot: tuple[float, float], prepared: Prepared) -> None:
    drives = Drives(prepared, Place(*spot, exact=True), START)
    point = drives.terrain.point_at(*spot)
    for _ in range(80):
        drives.tick()
        if heard_on(drives) == point:
            break
    else:
        pytest.fail(f"it is at {drives.pose}")
    for _ in range(5):
        drives.tick()
        assert heard_on(drives) == point


@settings(max_examples=15, deadline=None)
@given(heading=st.floats(-3.1, 3.1), x=st.integers(35, 130), y=st.integers(35, 90))
def test_it_ends_where_others_hear_it_on_a_small_point(heading: float, x: int, y: int, fine: Prepared) -> None:
    """Others hear places rounded to centimetres, and what is seen from a place is computed from that."""
    drives = Drives(fine, Place(0.1 * x + 0.05, 0.1 * y + 0.05, exact=True), Pose(10.0, 5.0, heading))
    for _ in range(120):
        drives.tick()
        if heard_on(drives) == (y, x):
            break
    else:
        pytest.fail(f"it is at {drives.pose}")
    drives.tick()
    assert heard_on(drives) == (y, x)


def heard_on(drives: Drives) -> tuple[int, int]:
    """The point on which others hear the robot."""
    heard = as_received(drives.pose)
    return drives.terrain.point_at(heard.x, heard.y)


def test_without_being_asked_it_stays_beside_some_of_them(prepared: Prepared) -> None:
    beside = 0
    for spot in SPOTS:
        drives = Drives(prepared, Place(*spot), START)
        for _ in range(80):
            drives.tick()
        beside += drives.terrain.point_at(drives.pose.x, drives.pose.y) != drives.terrain.point_at(*spot)
    assert beside > 0
