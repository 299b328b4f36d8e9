"""Taking part in the plan: robots are where it has them, come back to it, and pass each other unheard."""

import itertools
import math
from typing import Any

import numpy as np
import pytest

from agent.policies.common_plan import following as module
from agent.policies.common_plan.following import Followed
from agent.policies.common_plan.missed import Missed
from agent.policies.common_plan.plan import CommonPlan
from agent.policies.living import Living
from agent.policies.pursuit import Pursuit
from agent.ports import Stay
from agent.view import View
from patrol.pose import MODELS, Pose
from tests.agent.minds import STEP
from tests.agent.plans import Robots, Says, plan, prepared_in
from tests.agent.policies.test_stochastic import STARTS, drawn_of, patrol, plans_of
from tests.present import present

HEARS_BADLY = property(lambda _: False, lambda *_: None)

FOUR = [*STARTS, Pose(2.0, 18.0, 0.0), Pose(20.0, 14.0, 0.0)]


@pytest.fixture(autouse=True)
def _follow(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let robots follow the plan from the start, however well they hear."""
    monkeypatch.setattr(Living, "hears_well", HEARS_BADLY, raising=False)


def losing(share: float, *arguments: Any, **settings: Any) -> Robots:
    robots, dice = Robots(patrol(*arguments, **settings)), np.random.default_rng(1)
    robots.is_lost = lambda _k, _sender, _hearer: bool(dice.random() < share)
    return robots


def followed(robots: Robots, robot: int = 0) -> Followed:
    """The plan of a robot, and where the robot is on it."""
    on_plan = present(drawn_of(robots, robot)._on_plan)
    return present(on_plan._followed)


def away_m(robots: Robots) -> list[float]:
    """Return the distances of robots from where the plan has them, m."""
    plan = present(plans_of(robots)[0])
    plan.advance_to(robots.k)
    places = np.array([(body.pose.x, body.pose.y) for body in robots.bodies])
    return np.sqrt(((plan.places(robots.k) - places) ** 2).sum(axis=1)).tolist()  # type: ignore[no-any-return]


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("share", [0.0, 0.9, 1.0])
def test_robots_are_where_the_plan_has_them_whatever_is_lost(model: str, share: float) -> None:
    robots, away = losing(share, model=model), list[float]()
    for _ in range(600):
        robots.tick()
        assert not any(body.bumped for body in robots.bodies)
        assert list(present(plans_of(robots)[0]).rows) == [1, 2], "none is taken for dead"
        away += away_m(robots)
    assert np.mean(np.array(away) < 0.01) > 0.95


def test_robots_that_hear_nothing_pass_each_other() -> None:
    robots, apart_m = losing(1.0, FOUR, sensor={"range": 2.0}), list[float]()
    for _ in range(1200):
        robots.tick()
        assert not any(body.bumped for body in robots.bodies)
        places = [(body.pose.x, body.pose.y) for body in robots.bodies]
        apart_m.append(min(math.dist(*pair) for pair in itertools.combinations(places, 2)))
    assert min(apart_m) < 1.5


def test_one_that_is_not_where_the_plan_has_it_is_given_way_to_where_it_is() -> None:
    robots = losing(0.0)
    for _ in range(50):
        robots.tick()
    # The second one stands in the corridor, and is heard there.
    robots.bodies[1].pose = Pose(11.0, 10.0, 0.0)
    robots.minds[1].policy = Says(Stay())
    for _ in range(50):
        robots.tick()
        assert not any(body.bumped for body in robots.bodies)


@pytest.mark.parametrize("model", MODELS)
def test_one_that_was_moved_aside_comes_back_to_its_part(model: str) -> None:
    robots = losing(1.0, model=model)
    for _ in range(100):
        robots.tick()
    robots.bodies[0].pose = Pose(11.0, 10.0, 0.0)
    robots.tick()
    assert not followed(robots).is_on
    robots.until(lambda: followed(robots).is_on, 200)
    for _ in range(30):
        robots.tick()
        assert followed(robots).is_on


def test_one_that_was_pushed_a_little_sees_what_the_plan_s_robot_sees() -> None:
    robots = losing(1.0)
    for _ in range(100):
        robots.tick()
    pose = robots.bodies[0].pose
    robots.bodies[0].pose = Pose(pose.x + 0.1, pose.y + 0.1, pose.heading)
    for _ in range(20):
        robots.tick()
    at = followed(robots).at
    planned = followed(robots).plan.poses(1, at + 1, at + 2)[0]
    assert math.dist(planned[:2], (robots.bodies[0].pose.x, robots.bodies[0].pose.y)) < 0.02


@pytest.mark.parametrize("ticks", [1, 80, 300])
def test_one_that_takes_another_for_dead_for_a_while_goes_on_where_it_was(
    monkeypatch: pytest.MonkeyPatch, ticks: int
) -> None:
    robots = losing(1.0)
    for _ in range(200):
        robots.tick()
    before = followed(robots)
    monkeypatch.setattr(Living, "note", lambda self, _view: frozenset({self._number}))
    for _ in range(ticks):
        robots.tick()
        assert plans_of(robots) == [None, None], "choices are free"
    monkeypatch.undo()
    monkeypatch.setattr(Living, "hears_well", HEARS_BADLY, raising=False)
    robots.tick()
    assert followed(robots) is before
    robots.until(lambda: followed(robots).is_on, 5 if ticks == 1 else 200)
    assert before.fell_behind is None, "it was not slow meanwhile"


def test_one_that_falls_behind_again_chooses_freely_until_the_next_hour(monkeypatch: pytest.MonkeyPatch) -> None:
    robots = losing(1.0)
    robots.tick()
    hour_s = 10.0 * followed(robots).plan.interval_s
    monkeypatch.setattr(module, "HOUR_S", hour_s)
    slow, fell = robots.bodies[0], list[int]()

    def drive() -> None:
        before = slow.pose
        robots.tick()
        if robots.k % 2 == 0:
            slow.pose = before  # its wheels slip

    while not followed(robots).is_too_slow:
        drive()
        if (behind := followed(robots).fell_behind) is not None and behind not in fell:
            fell.append(behind)
        assert robots.k * STEP < hour_s
    assert len(fell) == 2
    assert not followed(robots, 1).is_too_slow, "the other one keeps to the plan"
    assert not followed(robots).is_on
    while robots.k * STEP < hour_s:
        drive()
    robots.until(lambda: followed(robots).is_on, 100)


def test_all_that_it_has_left_out_is_noted_little_by_little(monkeypatch: pytest.MonkeyPatch) -> None:
    left_out, real = list[tuple[int, int]](), Missed.skip

    def skip(self: Missed, first: int, until: int, view: View) -> None:
        if view.spec.number == 1 and until > first:
            left_out.append((first, until))
        real(self, first, until, view)

    robots = losing(1.0)
    for _ in range(50):
        robots.tick()
    policy = robots.minds[0].policy
    robots.minds[0].policy = Says(Stay())
    for _ in range(60):
        robots.tick()
    robots.minds[0].policy = policy
    monkeypatch.setattr(Missed, "skip", skip)
    robots.until(lambda: bool(left_out) and followed(robots).done == followed(robots).at, 200)
    noted = [tick for first, until in left_out for tick in range(first, until)]
    assert len(noted) > module.CATCH_UP
    assert noted == list(range(noted[0], noted[-1] + 1)), "each once"
    assert max(until - first for first, until in left_out) <= module.CATCH_UP


def test_where_no_way_leads_on_choices_are_free_until_one_does(monkeypatch: pytest.MonkeyPatch) -> None:
    robots = losing(1.0)
    for _ in range(50):
        robots.tick()
    # It is off the plan, so it needs a way there.
    robots.bodies[0].pose = Pose(11.0, 10.0, 0.0)
    monkeypatch.setattr(Pursuit, "go_to", lambda *_arguments: None)
    for _ in range(200):
        robots.tick()
    monkeypatch.undo()
    monkeypatch.setattr(Living, "hears_well", HEARS_BADLY, raising=False)
    robots.until(lambda: followed(robots).is_on, 300)


def test_more_robots_than_stations_go_on() -> None:
    """Spare robots that have come to a small ground, and hear nothing."""
    rooms = plan((9.0, 6.0), (0.0, 0.0, 4.0, 6.0), (4.0, 2.0, 5.0, 4.0), (5.0, 0.0, 9.0, 6.0))
    starts = [Pose(x, y, 0.0) for x in (1.0, 3.0, 6.0, 8.0) for y in (1.0, 5.0)]
    body = {"radius": 0.3, "speed": 1.0, "model": "holonomic"}
    robots = Robots(prepared_in(rooms, starts, body, spares=7, sensor={"range": 2.5}, patrol={"policy": "stochastic"}))
    fog = robots.minds[0].belief.fog
    robots.until(lambda: int(fog.last_seen[fog.patrolled].min()) >= 100, 400)
    assert present(plans_of(robots)[0]).origin == 0


def test_one_that_joins_works_the_plan_out_little_by_little(monkeypatch: pytest.MonkeyPatch) -> None:
    worked_out, real = list[int](), CommonPlan.advance_to

    def advance_to(self: CommonPlan, tick: int) -> None:
        before = self.tick
        real(self, tick)
        worked_out.append(self.tick - before)

    robots = losing(1.0)
    robots.k = 1000
    monkeypatch.setattr(CommonPlan, "advance_to", advance_to)
    ticks = 0
    while present(robots.tick()) and present(plans_of(robots)[0]).tick < robots.k:
        ticks += 1
    assert max(worked_out) <= module.CATCH_UP
    assert ticks >= 1000 // module.CATCH_UP - 1


def test_a_plan_begins_anew_on_the_hour(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "HOUR_S", 50.0)
    robots, origins = losing(1.0), set()
    for _ in range(250):
        robots.tick()
        origins.add(present(plans_of(robots)[0]).origin)
    assert origins == {0, 100, 200}
