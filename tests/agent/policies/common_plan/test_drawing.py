"""Routes of all robots: they begin along the round, and what was seen goes to the robot that comes by next."""

from itertools import pairwise

import numpy as np
import pytest

from agent.build import Shared
from agent.policies.common_plan.drawing import Drawing, Part, Parts, _put_behind
from agent.ports import GroundSetup, PolicySetup, RobotSetup
from patrol.pose import Pose
from tests.agent.plans import stations_of
from tests.agent.policies.test_stochastic import STARTS, patrol


def drawing_of(speeds: tuple[float, ...], policy: str = "committed") -> Drawing:
    prepared = patrol([*STARTS, Pose(2.0, 18.0, 0.0)][: len(speeds)], policy=policy, speeds=speeds)
    shared, scenario = Shared(prepared), prepared.scenario
    spec, fields = scenario.roster[0], prepared.fields[1]
    ground = GroundSetup(prepared.terrain, fields, shared.posts_of(fields), shared.footprint, shared.known, {})
    setup = PolicySetup(RobotSetup(spec, scenario.lengths[1]), ground, shared.fleet, shared.kind.options)
    return Drawing(setup, stations_of(prepared), scenario.roster)


@pytest.mark.parametrize("speeds", [(1.0,), (1.0, 1.0), (0.5, 1.5), (0.5, 1.0, 1.5)])
def test_routes_of_which_nothing_is_drawn_begin_along_the_round_as_long_as_robots_are_fast(
    speeds: tuple[float, ...],
) -> None:
    drawing = drawing_of(speeds)
    size = len(drawing._known)
    leads = drawing.leads_s(
        np.array([(start.x, start.y, 0.0) for start in [*STARTS, Pose(2.0, 18.0, 0.0)][: len(speeds)]])
    )
    routes = drawing._follow_round(leads)
    assert sorted(station for route in routes for station in route) == list(range(size))
    for route, speed in zip(routes, speeds, strict=True):
        assert len(route) == pytest.approx(size * speed / sum(speeds), abs=1.0)
        assert {(after - before) % size for before, after in pairwise(route)} <= {1}


def test_what_was_seen_goes_behind_the_nearest_last_station() -> None:
    apart_m = abs(np.subtract.outer(np.arange(6.0), np.arange(6.0)))
    rows, worth = [[1, 2, 5, 3], [4, 0]], np.array([True, False, False, True, True, True])
    _put_behind(rows, 0, worth, apart_m)
    assert rows == [[5, 3, 2], [4, 0, 1]]
    rows = [[3], [4, 0]]
    _put_behind(rows, 0, worth, apart_m)
    assert rows == [[3], [4, 0]], "a route keeps a station"


def test_a_station_that_is_given_up_is_not_gone_to_again_at_once() -> None:
    drawing = drawing_of((1.0,))
    size = len(drawing._known)
    ages = np.full(size, 100.0)
    ages[0] = 500.0
    leads = drawing.leads_s(np.array([(STARTS[0].x, STARTS[0].y, 0.0)]))
    parts = Parts({1: Part([0, *range(1, size)])})
    drawing.draw(parts, [1], [1], 100, ages, leads, lambda *_: 0.5)
    assert parts.each[1].route[0] != 0
    assert sorted(parts.each[1].route) == list(range(size))
