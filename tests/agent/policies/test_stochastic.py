"""The patrol that draws: it sees everything, again and again, and somebody without its draws cannot tell where next."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from agent.chance import Chance
from agent.policies import stochastic
from agent.policies.common_plan import stations
from agent.policies.common_plan.following import OnPlan
from agent.policies.common_plan.plan import CommonPlan
from agent.policies.stochastic import Drawn, Stochastic
from patrol.ground.terrain import Terrain
from patrol.pose import MODELS, Pose
from patrol.prepare import Prepared
from tests.agent.plans import Robots, plan, prepared_in
from tests.present import present

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
    policy: str = "stochastic",
    **sections: Any,
) -> Prepared:
    section = {"policy": policy, "options": dict(options or {})}
    sections = {"sensor": {"range": 4.0}, **sections, "patrol": section}
    prepared = prepared_in(rooms(), starts, {**BASE, "model": model}, **sections)
    return replace(prepared, scenario=prepared.scenario.model_copy(update={"seed": seed}))


def drawn_of(robots: Robots, robot: int = 0) -> Drawn:
    choice = robots.policy(Stochastic, robot).choice
    assert isinstance(choice, Drawn)
    return choice


def stations_of(robots: Robots) -> list[int | None]:
    """The stations to which robots go that hear each other."""
    drawn = [drawn_of(robots, robot) for robot in range(len(robots.minds))]
    return [choice._believed._station if choice._choice is choice._believed else None for choice in drawn]


def plans_of(robots: Robots) -> list[CommonPlan | None]:
    """The plans that robots follow that do not hear each other well."""
    drawn = [drawn_of(robots, robot) for robot in range(len(robots.minds))]
    followed = [choice._choice._followed if isinstance(choice._choice, OnPlan) else None for choice in drawn]
    return [one.plan if one is not None else None for one in followed]


def places(robots: Robots, ticks: int) -> list[tuple[float, float]]:
    """Return the places of the first robot after each tick."""
    passed = []
    for _ in range(ticks):
        robots.tick()
        pose = robots.bodies[0].pose
        passed.append((pose.x, pose.y))
    return passed


@pytest.mark.parametrize("model", MODELS)
def test_all_of_the_ground_is_seen_again_and_again(model: str) -> None:
    robots = Robots(patrol(model=model))
    fog = robots.minds[0].belief.fog
    robots.until(lambda: fog.seen == fog.points, 600)
    begun = robots.k
    patrolled = fog.last_seen >= 0
    robots.until(lambda: int(fog.last_seen[patrolled].min()) >= begun, 600)


def test_other_draws_give_another_order_and_the_same_ones_the_same() -> None:
    orders = [places(Robots(patrol(seed=seed)), 300) for seed in (1, 1, 2)]
    assert orders[0] == orders[1]
    assert orders[0] != orders[2]


@pytest.mark.parametrize("share", [0.0, 1.0 - 0.5**53], ids=["least", "largest"])
def test_a_station_is_drawn_whatever_the_draw(share: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Chance, "draw", lambda _self, *_question: share)
    robots = Robots(patrol())
    robots.tick()
    assert None not in stations_of(robots)


def mean_oldest(robots: Robots, ticks: int = 800) -> float:
    """The mean age of the stalest point after half of the time, ticks, as all robots together saw it."""
    fogs, stalest = [mind.belief.fog for mind in robots.minds], []
    points = np.flatnonzero(fogs[0].patrolled)
    for _ in range(ticks):
        robots.tick()
        if robots.k > ticks // 2:
            seen = np.maximum.reduce([fog.last_seen.take(points) for fog in fogs])
            stalest.append(robots.k - int(seen.min()))
    return float(np.mean(stalest))


def test_ground_gets_older_the_less_predictable_robots_are() -> None:
    steady, wild = (Robots(patrol(options={"unpredictability": value})) for value in (0.0, 20.0))
    assert mean_oldest(steady) < 0.95 * mean_oldest(wild)


@pytest.mark.parametrize(("share", "well"), [(0.0, True), (0.005, True), (0.05, False), (0.9, False), (1.0, False)])
def test_where_positions_are_lost_robots_follow_a_plan_that_is_as_fresh(share: float, well: bool) -> None:
    whole, lossy = Robots(patrol()), Robots(patrol())
    dice = np.random.default_rng(1)
    lossy.is_lost = lambda _k, _sender, _hearer: bool(dice.random() < share)
    assert mean_oldest(lossy) < 1.15 * mean_oldest(whole)
    assert [plan_ is None for plan_ in plans_of(lossy)] == [well] * 2


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_the_others_take_over_what_a_dead_robot_had_and_it_comes_back(share: float) -> None:
    robots, dice = Robots(patrol([*STARTS, Pose(2.0, 18.0, 0.0)])), np.random.default_rng(1)
    robots.is_lost = lambda _k, _sender, _hearer: bool(dice.random() < share)
    for _ in range(300):
        robots.tick()
    robots.until(lambda: plans_of(robots)[:2] == [None, None], 600, up=[0, 1])
    begun = robots.k

    def oldest() -> int:
        fogs = [mind.belief.fog for mind in robots.minds[:2]]
        return int(np.maximum.reduce([fog.last_seen for fog in fogs])[fogs[0].patrolled > 0].min())

    robots.until(lambda: oldest() >= begun, 1000, up=[0, 1])
    for _ in range(100):
        robots.tick()
    rows = [None if plan_ is None else list(plan_.rows) for plan_ in plans_of(robots)[:2]]
    assert rows == [[1, 2, 3] if share else None] * 2


@pytest.mark.parametrize("together", [1, 2])
def test_where_much_is_lost_a_death_leaves_no_ground_unseen_in_any_group(
    together: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stations, "MOST_TOGETHER", together)
    starts = [*STARTS, Pose(2.0, 18.0, 0.0), Pose(20.0, 14.0, 0.0)]
    robots, dice = Robots(patrol(starts, sensor={"range": 2.0})), np.random.default_rng(1)
    robots.is_lost = lambda _k, _sender, _hearer: bool(dice.random() < 0.5)
    for _ in range(100):
        robots.tick()
    assert {len(present(plan_).rows) for plan_ in plans_of(robots)} == {together}
    robots.until(lambda: plans_of(robots)[1:] == [None] * 3, 600, up=[1, 2, 3])
    begun, fogs = robots.k, [mind.belief.fog for mind in robots.minds[1:]]
    points = fogs[0].patrolled > 0
    robots.until(lambda: np.maximum.reduce([fog.last_seen for fog in fogs])[points].min() >= begun, 1000, up=[1, 2, 3])


def test_a_spare_robot_that_comes_and_goes_makes_no_plan_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    made, real = list[int](), CommonPlan.__init__

    def make(self: CommonPlan, setup: Any, known: Any, robots: Sequence[Any], origin: int) -> None:
        real(self, setup, known, robots, origin)
        made.append(len(robots))

    def is_shared(up: list[int]) -> bool:
        plans = [plans_of(robots)[robot] for robot in up]
        return all(plan_ is not None and len(plan_.rows) == len(up) for plan_ in plans)

    monkeypatch.setattr(CommonPlan, "__init__", make)
    starts = [*STARTS, Pose(2.0, 18.0, 0.0)]
    robots, dice = Robots(patrol(starts, sensor={"range": 2.0}, spares=1)), np.random.default_rng(1)
    robots.is_lost = lambda _k, _sender, _hearer: bool(dice.random() < 0.5)
    for _ in range(2):
        for up in [0, 1, 2], [0, 1]:
            robots.until(partial(is_shared, up), 600, up)
    assert sorted(made) == [2, 3]


def test_a_robot_that_was_moved_aside_comes_back_to_its_part() -> None:
    robots = Robots(patrol())
    for _ in range(100):
        robots.tick()
    robots.bodies[0].pose = Pose(11.0, 10.0, 0.0)
    fog = robots.minds[0].belief.fog
    begun = robots.k
    robots.until(lambda: int(fog.last_seen[fog.patrolled].min()) >= begun, 600)


def test_robots_share_the_stations_out() -> None:
    one, two = Robots(patrol(STARTS[:1])), Robots(patrol())
    assert mean_oldest(two) < 0.75 * mean_oldest(one)


def test_a_fleet_of_several_speeds_and_bodies_draws_too() -> None:
    robots = Robots(patrol(speeds=(1.0, 0.6), models=("holonomic", "differential")))
    fog = robots.minds[0].belief.fog
    robots.until(lambda: fog.seen == fog.points, 600)
    assert None not in stations_of(robots)


def test_where_there_is_no_round_each_choice_is_free() -> None:
    robots = Robots(patrol(sensor={"range": 4.0, "quality": 0.5}))
    assert not isinstance(robots.policy(Stochastic).choice, Drawn)
    fog = robots.minds[0].belief.fog
    robots.until(lambda: fog.seen > 0.9 * fog.points, 900)


@pytest.mark.parametrize(
    ("range_m", "limits", "crowded"),
    [
        (1.0, {}, False),
        (5.0, {}, True),
        (1.0, {"SHORT": 1000.0}, True),
        (1.0, {"SHORT_DENSE": 1000.0}, False),
        (1.0, {"SHORT_DENSE": 1000.0, "DENSE": 0.0}, True),
        (1.0, {"MOST_PLANNED": 3}, True),
    ],
    ids=["large", "small", "short", "not dense", "dense", "too large"],
)
def test_where_robots_are_crowded_each_choice_is_free(
    range_m: float, limits: dict[str, float], crowded: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Four robots in two rooms, with fewer stations than four for each where they see 5 m far."""
    for name, limit in limits.items():
        monkeypatch.setattr(stochastic, name, limit)
    rooms = plan((9.0, 6.0), (0.0, 0.0, 4.0, 6.0), (4.0, 2.0, 5.0, 4.0), (5.0, 0.0, 9.0, 6.0))
    starts = [Pose(1.0 + 2.0 * i, 3.0, 0.0) for i in range(4)]
    settings: dict[str, Any] = {"patrol": {"policy": "stochastic"}, "sensor": {"range": range_m}}
    robots = Robots(prepared_in(rooms, starts, {"radius": 0.3, "speed": 1.0}, **settings))
    for _ in range(100):
        robots.tick()
    assert [station is None for station in stations_of(robots)] == [crowded] * 4
    fog = robots.minds[0].belief.fog
    robots.until(lambda: fog.seen == fog.points, 300)


def test_robots_that_look_ahead_share_their_rounds_with_those_of_their_model() -> None:
    robots = Robots(patrol(models=("holonomic", "differential"), sensor={"range": 4.0, "angle": 90.0}))
    first, second = (robots.policy(Stochastic, robot)._sharing for robot in range(2))
    assert (first, second) == ((1, frozenset({1})), (2, frozenset({2})))


@pytest.mark.parametrize("loss", [False, True])
@pytest.mark.parametrize("model", ["holonomic", "differential"])
def test_a_fleet_that_looks_ahead_plans_and_sees_everything(model: str, loss: bool) -> None:
    ready = patrol(model=model, sensor={"range": 4.0, "angle": 90.0})
    robots = Robots(ready)
    robots.is_lost = lambda k, sender, hearer: loss and (k + sender + hearer) % 3 > 0
    for _ in range(500):
        robots.tick()
    assert all(isinstance(drawn_of(robots, robot)._choice, OnPlan) is loss for robot in range(2))
    last_seen = np.maximum(*(mind.belief.fog.last_seen for mind in robots.minds))
    assert (500 - last_seen[ready.fields[1].patrolled]).max() < 300
