"""The common plan: the same for all that work it out, fresh, and driven as its robots drive."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from agent.build import Shared
from agent.policies.common_plan.plan import CommonPlan
from agent.policies.common_plan.robots import PACE, Visit
from agent.policies.common_plan.stations import KnownStations
from agent.ports import GroundSetup, PolicySetup, RobotSetup
from patrol.measures.best_tour import rounds_of
from patrol.pose import MODELS, Pose
from patrol.prepare import Prepared
from patrol.radio.message import as_received
from tests.agent.minds import STEP
from tests.agent.plans import prepared_in, two_rooms
from tests.present import present

STARTS = [Pose(1.0, 1.0, 0.0), Pose(20.0, 6.0, 0.0)]


def prepared(
    model: str = "holonomic", speeds: tuple[float, ...] = (1.0, 1.0), unpredictability: float = 1.0
) -> Prepared:
    robots = {"radius": 0.3, "speed": 1.0, "turning_radius": 0.6, "model": model}
    patrol = {"policy": "stochastic", "options": {"unpredictability": unpredictability}}
    return prepared_in(two_rooms(), STARTS, robots, speeds=speeds, sensor={"range": 3.0}, patrol=patrol)


def plan_on(ready: Prepared, origin: int = 0, weights: NDArray[np.float64] | None = None) -> CommonPlan:
    shared = Shared(ready)
    spec = ready.scenario.roster[0]
    fields = ready.fields[1]
    ground = GroundSetup(ready.terrain, fields, shared.posts_of(fields), shared.footprint, shared.known, {})
    robot = RobotSetup(spec, ready.scenario.lengths[1])
    setup = PolicySetup(robot, ground, shared.fleet, ready.scenario.patrol.options)
    known = KnownStations(present(rounds_of(ready)[1]), weights)
    return CommonPlan(setup, known, ready.scenario.roster, origin)


def visits_of(plan: CommonPlan, number: int, ticks: int) -> list[Visit]:
    """The visits of a robot that are over by a tick, of a plan that has just begun."""
    visit, visits = plan.visit_at(number, plan.origin), list[Visit]()
    assert visit.begun == plan.origin
    while plan.finish(visit) <= plan.origin + ticks:
        visits.append(visit)
        visit = present(visit.then)
    return visits


@pytest.mark.parametrize("number", [1, 2])
def test_all_that_work_it_out_find_the_same_whenever_they_do(number: int) -> None:
    first, second = plan_on(prepared()), plan_on(prepared())
    begun = first.visit_at(number, 0)
    first.advance_to(200)
    for other in visits_of(second, number, 200):
        assert (begun.station, begun.begun, begun.ended) == (other.station, other.begun, other.ended)
        assert begun.trail == other.trail
        assert begun.points.tolist() == other.points.tolist()
        begun = present(begun.then)


@pytest.mark.parametrize("model", MODELS)
def test_every_point_is_seen_again_and_again(model: str) -> None:
    plan = plan_on(prepared(model))
    known = KnownStations(present(rounds_of(prepared(model))[1]))
    plan.advance_to(300)
    begun = plan.tick
    plan.advance_to(700)
    assert plan._ground.last_seen.flat[known.points].min() > begun


@pytest.mark.parametrize("model", MODELS)
def test_its_robots_drive_no_faster_than_bodies_do_and_keep_to_their_ground(model: str) -> None:
    ready = prepared(model)
    plan, reach = plan_on(ready), ready.fields[1].reach
    for visit in visits_of(plan, 1, 300):
        assert len(visit.trail) == present(visit.ended) - visit.begun
        for (x, y), (to_x, to_y) in zip(visit.trail, visit.trail[1:], strict=False):
            assert math.hypot(to_x - x, to_y - y) <= PACE[model] * STEP + 0.01
        for place in visit.trail:
            row, col = ready.terrain.nearest_point(*place)
            assert reach[max(row - 1, 0) : row + 2, max(col - 1, 0) : col + 2].any()


def test_its_robots_look_from_where_a_body_that_is_there_looks_from() -> None:
    for visit in visits_of(plan_on(prepared()), 1, 300):
        for x, y in visit.trail:
            assert as_received(Pose(x, y, 0.0)) == Pose(x, y, 0.0)


def test_points_of_a_visit_are_seen_from_their_places_of_the_trail() -> None:
    ready = prepared()
    shared = Shared(ready)
    seen, points = 0, 0
    for visit in visits_of(plan_on(ready), 1, 300):
        for point, place in zip(visit.points.tolist(), visit.places.tolist(), strict=True):
            view = shared.footprint.visible(Pose(*visit.trail[place], 0.0))
            row, col = divmod(point, ready.terrain.width)
            seen += bool(view.mask[row - view.row0, col - view.col0])
            points += 1
        assert (visit.seen_before < present(visit.ended)).all()
    assert points > 1000
    assert seen >= 0.99 * points, "but for a few that are too near to a wall"


def test_fast_robots_make_more_of_the_visits() -> None:
    ready = prepared(speeds=(2.0, 1.0))
    fast, slow = ([visit.trail for visit in visits_of(plan_on(ready), number, 800)] for number in (1, 2))
    assert len(fast) > 1.3 * len(slow)


def test_a_later_plan_begins_with_robots_spread_over_the_round() -> None:
    ready = prepared()
    plan = plan_on(ready, origin=7200)
    places = [robot.place for robot in plan.robots]
    assert math.dist(*places) > 4.0
    assert plan.visit_at(1, 7200).begun == 7200
    ages = 7200 - plan._ground.last_seen.flat[present(rounds_of(ready)[1]).points]
    assert ages.max() * STEP <= plan.interval_s + STEP


def test_other_seeds_and_unpredictability_give_other_orders() -> None:
    def order(ready: Prepared) -> list[int]:
        return [visit.station for visit in visits_of(plan_on(ready), 1, 400)]

    assert order(prepared()) == order(prepared())
    assert order(prepared()) != order(prepared(unpredictability=0.0))


def test_what_weighs_more_is_seen_more_often() -> None:
    ready = prepared(unpredictability=0.0)
    weights = np.ones(ready.terrain.shape)
    weights[:, : ready.terrain.width // 3] = 3.0
    counts = np.zeros(ready.terrain.shape)
    for number in (1, 2):
        for visit in visits_of(plan_on(ready, weights=weights), number, 800):
            counts.flat[visit.points] += 1
    patrolled = ready.patrolled
    assert counts[patrolled & (weights > 1.0)].mean() > 1.3 * counts[patrolled & (weights == 1.0)].mean()
