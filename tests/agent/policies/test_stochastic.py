"""The patrol that draws: it sees everything, again and again, and somebody without its draws cannot tell where next."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from agent.chance import Chance
from agent.policies.stochastic import JointPlan, Stochastic
from patrol.ground.terrain import Terrain
from patrol.measures.best_tour import best_tour
from patrol.pose import MODELS, Pose
from patrol.prepare import Prepared
from patrol.random import Purpose
from tests.agent.minds import STEP
from tests.agent.plans import Robots, plan, prepared_in
from tests.present import present

# Not the product's own, so that a wrong one there is noticed.
STUCK_S = 30.0

BASE = {"radius": 0.3, "speed": 1.0, "turning_radius": 0.6}
STARTS = [Pose(2.0, 2.0, 0.0), Pose(20.0, 6.0, 3.0)]


def rooms() -> Terrain:
    """Four rooms of 8 x 8 m along a corridor."""
    left = [(0.0, y, 8.0, y + 8.0) for y in (0.0, 12.0)]
    right = [(14.0, y, 22.0, y + 8.0) for y in (0.0, 12.0)]
    return plan((22.0, 20.0), *left, *right, (8.0, 3.0, 14.0, 5.0), (8.0, 15.0, 14.0, 17.0), (10.0, 3.0, 12.0, 17.0))


def patrol(
    starts: list[Pose] = STARTS,
    model: str = "holonomic",
    options: Mapping[str, Any] | None = None,
    seed: int = 1,
    **sections: Any,
) -> Prepared:
    section = {"policy": "stochastic", "options": dict(options or {})}
    sections = {"sensor": {"range": 4.0}, **sections, "patrol": section}
    prepared = prepared_in(rooms(), starts, {**BASE, "model": model}, **sections)
    return replace(prepared, scenario=prepared.scenario.model_copy(update={"seed": seed}))


def plan_of(robots: Robots, robot: int = 0) -> JointPlan | None:
    choice = robots.policy(Stochastic, robot).choice
    return choice if isinstance(choice, JointPlan) else None


def choices_are_free(robots: Robots) -> bool:
    plans = [plan_of(robots, number) for number in range(len(robots.minds))]
    return all(plan_ is None or plan_.station is None for plan_ in plans)


def stations(robots: Robots, ticks: int) -> list[int | None]:
    """The first robot's stations in order."""
    visited: list[int | None] = []
    for _ in range(ticks):
        robots.tick()
        plan_ = present(plan_of(robots))
        if not visited or visited[-1] != plan_.station:
            visited.append(plan_.station)
    return visited


@pytest.mark.parametrize("model", MODELS)
def test_all_of_the_ground_is_seen_again_and_again(model: str) -> None:
    robots = Robots(patrol(model=model))
    fog = robots.minds[0].belief.fog
    robots.until(lambda: fog.seen == fog.points, 600)
    begun = robots.k
    patrolled = fog.last_seen >= 0
    robots.until(lambda: int(fog.last_seen[patrolled].min()) >= begun, 600)


def test_other_draws_give_another_order_and_the_same_ones_the_same() -> None:
    orders = [stations(Robots(patrol(seed=seed)), 300) for seed in (1, 1, 2)]
    assert orders[0] == orders[1]
    assert orders[0] != orders[2]


@pytest.mark.parametrize("share", [0.0, 1.0 - 0.5**53], ids=["least", "largest"])
def test_a_station_is_drawn_whatever_the_draw(share: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Chance, "draw", lambda _self, *_question: share)
    assert stations(Robots(patrol()), 1) != [None]


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
    stations(robots, 200)
    spell_s = 0.1 * present(best_tour(prepared).length_m) / 1.25 / 2.0
    assert len({spell for _, spell in asked}) > 10
    assert {spell - int(tick * STEP / spell_s) for tick, spell in asked} == {0}


def mean_oldest(robots: Robots, ticks: int = 800) -> float:
    """The mean age of the stalest point after half of the time, ticks."""
    fog, stalest = robots.minds[0].belief.fog, []
    for _ in range(ticks):
        robots.tick()
        stalest.append(fog.mfow(robots.k))
    return float(np.mean(stalest[ticks // 2 :]))


def test_ground_gets_older_the_less_predictable_robots_are() -> None:
    steady, wild = (Robots(patrol(options={"unpredictability": value})) for value in (0.0, 20.0))
    assert mean_oldest(steady) < 0.9 * mean_oldest(wild)


def test_robots_that_hear_each_other_hold_the_same_plan() -> None:
    robots = Robots(patrol())
    for _ in range(300):
        robots.tick()
        plans = [plan_of(robots, number) for number in range(2)]
        parts = [plan_.parts for plan_ in plans if plan_ is not None]
        assert [part.route for part in parts[0].values()] == [part.route for part in parts[1].values()]


@pytest.mark.parametrize(("share", "free"), [(0.02, False), (0.3, True)])
def test_where_many_positions_are_lost_each_choice_is_free(share: float, free: bool) -> None:
    whole, lossy = Robots(patrol()), Robots(patrol())
    dice = np.random.default_rng(1)
    lossy.is_lost = lambda _k, _sender, _hearer: bool(dice.random() < share)
    assert mean_oldest(lossy) < 1.2 * mean_oldest(whole)
    assert choices_are_free(lossy) == free


def test_a_robot_that_stands_still_is_left_out_of_the_plan() -> None:
    robots = Robots(patrol())
    for tick in range(round(2 * STUCK_S / STEP)):
        robots.tick()
        robots.bodies[1].pose = STARTS[1]
        plan_ = present(plan_of(robots))
        assert (2 in plan_.parts) == (tick * STEP <= STUCK_S), tick


def test_robots_share_the_stations_out() -> None:
    one, two = Robots(patrol(STARTS[:1])), Robots(patrol())
    assert mean_oldest(two) < 0.75 * mean_oldest(one)


def test_where_there_is_no_tour_each_choice_is_free() -> None:
    robots = Robots(patrol(sensor={"range": 4.0, "kind": "sector", "angle": 90.0}))
    assert plan_of(robots) is None
    fog = robots.minds[0].belief.fog
    robots.until(lambda: fog.seen > 0.9 * fog.points, 900)


def small(range_m: float, **settings: Any) -> Robots:
    """Four robots in two rooms of 12 m^2 for each."""
    rooms = plan((9.0, 6.0), (0.0, 0.0, 4.0, 6.0), (4.0, 2.0, 5.0, 4.0), (5.0, 0.0, 9.0, 6.0))
    starts = [Pose(1.0 + 2.0 * i, 3.0, 0.0) for i in range(4)]
    settings |= {"patrol": {"policy": "stochastic"}, "sensor": {"range": range_m}}
    return Robots(prepared_in(rooms, starts, {"radius": 0.3, "speed": 1.0}, **settings))


def test_more_robots_than_stations_go_on() -> None:
    """On ground with zones robots plan however crowded they are."""
    room = {"name": "left", "polygon": [[0.0, 0.0], [4.0, 0.0], [4.0, 6.0], [0.0, 6.0]], "weight": 2.0}
    robots = small(5.0, zones=[room])
    robots.tick()
    fewer = 0
    for _ in range(200):
        shared = present(plan_of(robots))
        routes = [part.route for part in shared.parts.values()]
        stations = sum(map(len, routes))
        assert stations <= len(routes)
        assert sum(map(bool, routes)) == stations, "a station is one robot's"
        fewer += stations < len(routes)
        robots.tick()
    assert fewer > 0
    fog = robots.minds[0].belief.fog
    assert fog.seen == fog.points


@pytest.mark.parametrize(("range_m", "crowded"), [(3.0, False), (5.0, True)])
def test_where_robots_are_crowded_each_choice_is_free(range_m: float, crowded: bool) -> None:
    """A quarter of what a sensor sees around it is 7 or 20 m^2."""
    robots = small(range_m)
    for _ in range(100):
        robots.tick()
    assert choices_are_free(robots) == crowded
