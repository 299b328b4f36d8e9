"""The common plan: the same for all that work it out, fresh, and driven as its robots drive."""

import itertools
import math

import numpy as np
import pytest
from numpy.typing import NDArray

from agent.build import Shared
from agent.policies.common_plan.plan import CommonPlan
from agent.policies.common_plan.robots import PACE
from agent.ports import GroundSetup, PolicySetup, RobotSetup
from patrol.ground.swept_path import advance, path_is_free
from patrol.pose import MODELS, Pose
from patrol.prepare import Prepared
from tests.agent.minds import STEP
from tests.agent.plans import prepared_in, stations_of, two_rooms

WILD = {"policy": "stochastic", "options": {"unpredictability": 20.0}}
STARTS = [Pose(1.0, 1.0, 0.0), Pose(20.0, 6.0, 0.0)]


def prepared(
    model: str = "holonomic",
    speeds: tuple[float, ...] = (1.0, 1.0),
    unpredictability: float = 1.0,
    angle: float = 360.0,
) -> Prepared:
    robots = {"radius": 0.3, "speed": 1.0, "turning_radius": 0.6, "model": model}
    patrol = {"policy": "stochastic", "options": {"unpredictability": unpredictability}}
    return prepared_in(two_rooms(), STARTS, robots, speeds=speeds, sensor={"range": 3.0, "angle": angle}, patrol=patrol)


def plan_on(ready: Prepared, origin: int = 0, weights: NDArray[np.float64] | None = None) -> CommonPlan:
    shared = Shared(ready)
    spec = ready.scenario.roster[0]
    fields = ready.fields[1]
    ground = GroundSetup(ready.terrain, fields, shared.posts_of(fields), shared.footprint, shared.known, {})
    robot = RobotSetup(spec, ready.scenario.lengths[1])
    setup = PolicySetup(robot, ground, shared.fleet, ready.scenario.patrol.options)
    known = stations_of(ready, weights)
    return CommonPlan(setup, known, ready.scenario.roster, origin)


def visits_of(plan: CommonPlan, number: int, ticks: int) -> list[int]:
    """The stations that a robot visits until a tick, in order."""
    visited = list[int]()
    for _ in range(ticks):
        station = plan._parts.each[number].route[0]
        if not visited or station != visited[-1]:
            visited.append(station)
        plan.advance_to(plan.tick + 1)
    return visited


def test_all_that_work_it_out_find_the_same_whenever_they_do() -> None:
    first, second = plan_on(prepared()), plan_on(prepared())
    first.advance_to(100)
    for tick in range(0, 100, 7):
        second.advance_to(tick + 1)
        for number in (1, 2):
            assert first.poses(number, tick, tick + 1).tolist() == second.poses(number, tick, tick + 1).tolist()
            assert first.command(number, tick) == second.command(number, tick)


@pytest.mark.parametrize("model", MODELS)
def test_every_point_is_seen_again_and_again(model: str) -> None:
    plan = plan_on(prepared(model))
    known = stations_of(prepared(model))
    plan.advance_to(300)
    begun = plan.tick
    plan.advance_to(700)
    assert plan.last_seen.flat[known.points].min() > begun


@pytest.mark.parametrize("model", MODELS)
def test_its_robots_do_what_bodies_can(model: str) -> None:
    ready = prepared(model)
    plan, spec = plan_on(ready), ready.scenario.roster[0]
    for tick in range(300):
        plan.advance_to(tick + 1)
        before, after = plan.poses(1, tick, tick + 2)
        command = plan.command(1, tick)
        assert command.is_within(spec.limits)
        assert command.speed_mps <= PACE * spec.speed * 1.001
        assert path_is_free(ready.terrain, Pose(*before), command, STEP, spec.radius)
        end = advance(Pose(*before), command, STEP)
        assert (end.x, end.y, end.heading) == pytest.approx(tuple(after))


@pytest.mark.parametrize("model", MODELS)
def test_its_robots_pass_each_other(model: str) -> None:
    starts = [*STARTS, Pose(6.0, 6.0, 0.0), Pose(16.0, 2.0, 3.0)]
    robots = {"radius": 0.3, "speed": 1.0, "turning_radius": 0.6, "model": model}
    plan = plan_on(prepared_in(two_rooms(), starts, robots, sensor={"range": 3.0}, patrol=WILD))
    apart_m = []
    for tick in range(1000):
        plan.advance_to(tick)
        apart_m.append(min(math.dist(*pair) for pair in itertools.combinations(plan.places(tick).tolist(), 2)))
    assert min(apart_m) >= 0.6 - 0.02, "two radii, but for the rounding of what is heard"
    assert min(apart_m) < 1.2


def test_fast_robots_make_more_of_the_visits() -> None:
    ready = prepared(speeds=(2.0, 1.0))
    fast, slow = (visits_of(plan_on(ready), number, 800) for number in (1, 2))
    assert len(fast) > 1.3 * len(slow)


def test_poses_are_remembered_for_a_while() -> None:
    plan = plan_on(prepared())
    plan.advance_to(1000)
    assert 0 < plan.since < 1000
    early = plan_on(prepared())
    early.advance_to(plan.since)
    assert plan.places(plan.since).tolist() == early.places(plan.since).tolist()


def test_a_later_plan_begins_with_robots_spread_over_the_round() -> None:
    ready = prepared()
    plan = plan_on(ready, origin=7200)
    assert math.dist(*plan.places(7200)) > 4.0
    assert plan.since == 7200
    ages = 7200 - plan.last_seen.flat[stations_of(ready).points]
    assert ages.max() * STEP <= plan.interval_s + STEP


def test_other_seeds_and_unpredictability_give_other_orders() -> None:
    def order(ready: Prepared) -> list[int]:
        return visits_of(plan_on(ready), 1, 400)

    assert order(prepared()) == order(prepared())
    assert order(prepared()) != order(prepared(unpredictability=0.0))


def test_what_weighs_more_is_seen_more_often() -> None:
    ready = prepared(unpredictability=0.0)
    weights = np.ones(ready.terrain.shape)
    weights[:, : ready.terrain.width // 3] = 3.0
    plan, ages = plan_on(ready, weights=weights), []
    for tick in range(800):
        plan.advance_to(tick)
        ages.append(tick - plan.last_seen)
    mean = np.mean(ages[200:], axis=0)
    patrolled = ready.patrolled
    assert mean[patrolled & (weights > 1.0)].mean() < 0.8 * mean[patrolled & (weights == 1.0)].mean()


@pytest.mark.parametrize("model", ["holonomic", "differential"])
def test_robots_of_the_plan_look_aside_and_see_all_ground_again_and_again(model: str) -> None:
    ready = prepared(model, angle=90.0)
    plan = plan_on(ready)
    plan.advance_to(400)
    ages = (plan.tick - plan.last_seen[ready.fields[1].patrolled]) * STEP
    assert ages.max() < 6.0 * plan.interval_s
    headings = plan.poses(1, 300, 400)[:, 2]
    driven = np.diff(plan.poses(1, 300, 400)[:, :2], axis=0)
    aside = [
        abs(math.remainder(heading - math.atan2(up, across), math.tau)) > 1.3
        for heading, (across, up) in zip(headings[1:].tolist(), driven.tolist(), strict=True)
        if math.hypot(across, up) > 0.1
    ]
    assert any(aside) is (model == "holonomic"), "the other one faces where it drives"
