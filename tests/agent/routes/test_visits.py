"""Visits to one-way zones: which steps lead too far back, and what a robot does where all ahead is closed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from agent.routes.ground import Ground
from agent.routes.routes import Routes
from agent.routes.visits import Visits
from patrol.ground.fields import compute_fields
from patrol.ground.terrain import Terrain
from patrol.pose import Pose, Velocity
from patrol.zones.ground import with_zones
from patrol.zones.spec import ZoneSpec
from tests.ring import LOWER, ring, zone

RADIUS, STEP = 0.3, 0.5
AISLE = zone("aisle", LOWER, 0)
AHEAD = (12.0, 2.25, 0.6)
"""A disc that closes the corridor."""


def ground_of() -> Ground:
    terrain = ring(AISLE)
    return Ground(terrain, compute_fields(terrain, RADIUS, 4.0, True, [Pose(3.0, 5.0, 0.0)]).reach)


def visits_of(ground: Ground) -> Visits:
    return Visits([ZoneSpec.model_validate(AISLE)], ground, RADIUS, STEP)


@pytest.mark.parametrize(
    ("xs", "to_x", "allowed"),
    [
        ((10.0,), 9.45, True),
        ((10.0,), 9.35, False),
        ((10.0, 12.0, 9.7), 9.35, False),  # where it came in counts, not where it turned
        ((8.0, 12.0), 11.5, True),
        ((6.1,), 5.9, True),  # out of the zone
        ((6.1, 5.0, 10.0), 9.35, False),  # the next visit
        ((13.9,), 13.4, True),
        ((13.9, 13.4), 13.2, False),
        ((10.0, 9.2), 9.1, False),  # it was pushed
        ((10.0, 9.2), 9.3, True),
        ((4.0,), 3.5, True),
    ],
)
def test_a_step_leads_back_to_the_entry_and_a_little_farther(xs: tuple[float, ...], to_x: float, allowed: bool) -> None:
    visits = visits_of(ground_of())
    for x in xs:
        visits.note(x, 2.25)
    pose = Pose(xs[-1], 2.25, 0.0)
    assert visits.allow(pose, Velocity((to_x - xs[-1]) / STEP, 0.0)) == allowed


def test_manoeuvres_keep_off_what_lies_behind() -> None:
    ground = ground_of()
    visits = visits_of(ground)
    visits.note(10.0, 2.25)
    assert ground.behind is not None
    assert [x / 2 for x in range(40) if ground.behind[4, x]] == [6.0 + 0.5 * k for k in range(7)]
    visits.note(15.0, 2.25)
    assert ground.behind is None


@pytest.mark.parametrize(("x", "before", "closed"), [(10.25, 28.82, 8.0), (4.25, 2.0, 2.0)])
def test_a_robot_in_the_zone_turns_back_where_all_ahead_is_closed(x: float, before: float, closed: float) -> None:
    """To x = 2.25 it takes 11 steps to the east room, 11 up, 23 along the corridor, and 7 and 4 aslant down again."""
    ground = ground_of()
    visits, routes = visits_of(ground), Routes(ground)
    for discs, expected in (((), before), ((AHEAD,), closed), ((), before)):
        ground.begin(discs)
        visits.note(x, 2.25)
        assert routes.lengths((x, 2.25))[4, 4] == pytest.approx(expected)
        way = routes.way((5, 1 + int(2 * x)), (5, 5))
        assert way.length == pytest.approx(expected)
        assert (way.bend[0] > x) == (expected == 28.82)


@pytest.mark.parametrize("origin", [(0.0, 0.0), (-7.5, 3.0)])
@pytest.mark.parametrize("degrees", [0, 45, 90, 135, 180, 225, 270, 315])
def test_behind_is_against_the_zones_direction(degrees: int, origin: tuple[float, float]) -> None:
    """In the middle of a zone of 8 x 8 m the robot may go back by two radii, 0.6 m, and no farther; to the side it may.

    Degrees count from the x axis towards the y axis.
    """
    left, low = origin[0] + 1.0, origin[1] + 1.0
    box = [[left, low], [left + 8.0, low], [left + 8.0, low + 8.0], [left, low + 8.0]]
    own = zone("hall", box, degrees)
    field = Terrain("field", np.ones((20, 20), dtype=np.bool_), 0.5, origin=origin)
    terrain = with_zones(field, [ZoneSpec.model_validate(own)])
    ground = Ground(terrain, terrain.free)
    visits = Visits([ZoneSpec.model_validate(own)], ground, RADIUS, STEP)
    across, up = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    x, y = origin[0] + 5.0, origin[1] + 5.0
    visits.note(x, y)
    for back_m, side_m, allowed in ((0.55, 0.0, True), (0.65, 0.0, False), (0.0, 1.0, True), (-2.0, 0.0, True)):
        step = (-back_m * across - side_m * up, -back_m * up + side_m * across)
        assert visits.allow(Pose(x, y, 0.0), Velocity(step[0] / STEP, step[1] / STEP)) == allowed
    assert ground.behind is not None
    rows, cols = np.indices(terrain.shape)
    along = (cols * 0.5 - 4.75) * across + (rows * 0.5 - 4.75) * up
    inside = (rows >= 2) & (rows < 18) & (cols >= 2) & (cols < 18)
    assert np.array_equal(ground.behind, inside & (along < -0.6))
