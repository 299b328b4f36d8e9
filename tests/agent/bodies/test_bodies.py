"""Bodies: what each makes of the intents, on ground with walls; and that none is ever led into one."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.bodies import BODIES
from agent.bodies.keeping_right import KeepingRight
from agent.build import Shared, build_mind
from agent.mind import Mind
from agent.ports import Bearing, Decision, Intent, Place, PolicyFailed, State, Stay, Steer
from agent.routes.ground import Spot
from agent.view import View
from patrol.ground.swept_path import advance, path_is_free
from patrol.ground.terrain import Terrain
from patrol.pose import COMMANDS, MODELS, Command, Drive, Limits, Pose, Twist, Velocity, command_of, is_halt
from patrol.prepare import Prepared
from patrol.radio.message import as_received
from patrol.scenario import load_scenario
from tests.agent.minds import STEP, at, prepared_on
from tests.agent.plans import Says
from tests.present import present

RADIUS, SPEED, TURNING = 1.0, 4.4, 3.5
LIMITS = Limits(SPEED, RADIUS, TURNING)
FIRST = Pose(5.0, 5.0, 0.3)
NEAR = {"holonomic": 0.01, "differential": 0.01, "car": 1.0}
"""Distance from a place to which each body comes, m."""
IN_TIME = {"holonomic": 40, "differential": 45, "car": 80}
"""Ticks for the way round the wall, of about 50 m."""


def walled() -> Terrain:
    """30 x 30 m; a wall over y in [15, 15.5) leaves a gap over x from 22 on, and a closed chamber fills a corner."""
    passable = np.ones((60, 60), dtype=np.bool_)
    passable[30, :44] = False
    passable[:16, 44] = passable[16, 44:] = False
    return Terrain("walled", passable, 0.5)


@pytest.fixture(scope="module")
def prepared() -> dict[str, Prepared]:
    """One robot on open ground, for each model."""
    mapping = {"terrain": {"builtin": "open"}, "point": 0.5}
    return {
        model: prepared_on(load_scenario({**mapping, "robots": {"count": 2, "model": model}}), walled(), [FIRST])
        for model in MODELS
    }


class Drives:
    """One robot of a model, moved as its body commands where walls allow it."""

    def __init__(self, prepared: Prepared, wants: Intent | Callable[[View], Intent], pose: Pose = FIRST) -> None:
        self.mind: Mind = build_mind(Shared(prepared), 1)
        self.mind.policy = Says(wants if callable(wants) else lambda _view: wants)
        self.terrain = prepared.terrain
        self.pose = pose
        self.k = 0

    def tick(self, bumped: bool = False) -> Decision:
        decision = self.mind.step(at(self.k, self.pose, bumped), [])
        self.k += 1
        assert path_is_free(self.terrain, self.pose, decision.command, STEP, RADIUS), "it drives into a wall"
        assert decision.command.is_within(LIMITS)
        self.pose = advance(self.pose, decision.command, STEP)
        return decision

    def until_near(self, spot: Spot, within: float, ticks: int) -> int:
        """Ticks until it is there; fails when it takes more."""
        for _ in range(ticks):
            if self.apart(spot) <= within:
                return self.k
            self.tick()
        assert self.apart(spot) <= within, f"it is at {self.pose} after {self.k} ticks"
        return self.k

    def apart(self, spot: Spot) -> float:
        return math.dist((self.pose.x, self.pose.y), spot)


def test_every_model_has_a_body() -> None:
    assert set(BODIES) == set(MODELS)


# --- Place -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("heading", [0.0, 1.5, 3.1, -1.5])
def test_a_place_behind_a_wall_is_reached_and_kept(model: str, heading: float, prepared: dict[str, Prepared]) -> None:
    spot = (5.1, 25.2)
    drives = Drives(prepared[model], Place(*spot, state="homing"), Pose(5.0, 5.0, heading))
    took = drives.until_near(spot, NEAR[model], IN_TIME[model])
    assert took >= (45.0 - NEAR[model]) / (SPEED * STEP), "that is too short a way"
    for _ in range(10):
        decision = drives.tick()
        assert drives.apart(spot) <= NEAR[model]
        assert decision.state == "homing"


@pytest.mark.parametrize("model", MODELS)
def test_a_place_is_the_goal_and_the_bend_on_the_way_the_refined_one(model: str, prepared: dict[str, Prepared]) -> None:
    drives = Drives(prepared[model], Place(5.1, 25.2))
    decision = drives.tick()
    assert decision.goal == (5.1, 25.2)
    assert decision.refined is not None
    assert decision.refined[0] > 21.0
    bearing = math.atan2(decision.refined[1] - FIRST.y, decision.refined[0] - FIRST.x)
    assert decision.direction == pytest.approx(bearing, abs=1e-9)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(
    "spot", [(26.0, 3.0), (5.0, 15.25), (-70.0, 5.0), (5.0, 400.0), (1e9, -1e9)], ids=["chamber", "wall", *"wnx"]
)
def test_an_unreachable_place_stands_for_the_nearest(model: str, spot: Spot, prepared: dict[str, Prepared]) -> None:
    drives = Drives(prepared[model], Place(*spot))
    goal = present(drives.tick().goal)
    reach = prepared[model].fields[1].reach
    row, col = drives.terrain.point_at(*goal)
    assert reach[row, col]
    asked = drives.terrain.point_at(*spot)
    inside = [min(max(place, 0), 59) for place in asked]
    nearest = np.sqrt(((np.argwhere(reach) - inside) ** 2).sum(axis=1)).min()
    assert math.dist((row, col), inside) == pytest.approx(nearest)
    drives.until_near(goal, NEAR[model], IN_TIME[model])


@pytest.mark.parametrize("model", MODELS)
def test_a_place_where_the_robot_stands_keeps_it_there(model: str, prepared: dict[str, Prepared]) -> None:
    drives = Drives(prepared[model], Place(FIRST.x, FIRST.y))
    for _ in range(5):
        drives.tick()
    assert (drives.pose.x, drives.pose.y) == (FIRST.x, FIRST.y)


def test_a_holonomic_body_leans_where_that_leads_on_and_takes_the_bend_where_not(prepared: dict[str, Prepared]) -> None:
    near = Pose(20.0, 16.6, 0.0)
    aside, into_the_wall = (20.0, 20.0), (20.0, 10.0)
    lean = Drives(prepared["holonomic"], Place(26.0, 16.6, bend=(26.0, 16.6), lean=aside), near)
    lean.tick()
    assert lean.pose.y > 18.0
    straight = Drives(prepared["holonomic"], Place(26.0, 16.6, bend=(26.0, 16.6), lean=into_the_wall), near)
    straight.tick()
    assert straight.pose.y == pytest.approx(16.6)
    assert straight.pose.x == pytest.approx(20.0 + SPEED * STEP)


def test_a_holonomic_body_that_bumps_on_its_way_steps_aside_now_and_then(prepared: dict[str, Prepared]) -> None:
    drives = Drives(prepared["holonomic"], Place(15.0, 5.0, bend=(15.0, 5.0)))
    bearings = []
    for _ in range(60):
        drives.pose = FIRST
        drives.tick(bumped=True)
        bearings.append(round(math.atan2(drives.pose.y - FIRST.y, drives.pose.x - FIRST.x), 6))
    straight = bearings.count(0.0)
    assert 15 <= straight <= 45
    assert len(set(bearings)) == 60 - straight + 1


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(
    "wander",
    [Place(15.0, 5.0, bend=(15.0, 5.0), wander=1.2, state="straying"), Bearing((0.0,), wander=1.2, state="straying")],
    ids=["place", "bearing"],
)
def test_a_wander_goes_first_for_one_step(model: str, wander: Intent, prepared: dict[str, Prepared]) -> None:
    drives = Drives(prepared[model], wander, Pose(5.0, 5.0, 1.2))
    decision = drives.tick()
    assert (decision.state, decision.direction, decision.goal) == ("straying", 1.2, None)
    assert math.atan2(drives.pose.y - 5.0, drives.pose.x - 5.0) == pytest.approx(1.2)
    drives.mind.policy = Says(lambda _: Place(15.0, 5.0, bend=(15.0, 5.0)))
    assert drives.tick().goal == (15.0, 5.0)


@pytest.mark.parametrize("model", MODELS)
def test_a_wander_into_a_wall_leads_as_far_as_there_is_room(model: str, prepared: dict[str, Prepared]) -> None:
    pose = Pose(10.0, 13.9, math.pi / 2)
    drives = Drives(prepared[model], Place(15.0, 13.9, bend=(15.0, 13.9), wander=math.pi / 2), pose)
    drives.tick()  # which checks walls
    assert drives.pose.y <= 14.0


def test_a_holonomic_body_takes_the_first_direction_that_leads_half_a_step_and_a_tenth_is_no_dead_end(
    prepared: dict[str, Prepared],
) -> None:
    """A step is 2.2 m. The nearer to the wall ahead it stands, the less far it gets; to the right there is room."""
    ways_m, ahead = [], math.pi / 2.0
    for centimetres in range(0, 300, 5):
        pose = Pose(10.25, 14.0 - 0.01 * centimetres, 0.0)
        alone, choosing = (
            Drives(prepared["holonomic"], Bearing(bearings, state="going"), pose).tick()
            for bearings in ((ahead,), (ahead, 0.0))
        )
        way_m = alone.command.speed_mps * STEP
        assert (alone.state == "going") is (way_m >= 0.22)
        assert choosing.direction == (ahead if way_m >= 1.1 else 0.0)
        ways_m.append(way_m)
    for least_m, most_m in ((0.11, 0.22), (0.22, 0.44), (0.55, 1.1), (1.1, 2.2)):
        assert any(least_m <= way_m < most_m for way_m in ways_m)


@pytest.mark.parametrize(("model", "stops"), [("holonomic", 4), ("differential", 6), ("car", 6)])
def test_a_body_that_would_touch_another_stops_for_so_many_ticks_and_then_drives(
    model: str, stops: int, prepared: dict[str, Prepared], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bump shows that the other one is there, so the count begins anew."""
    monkeypatch.setattr(KeepingRight, "room", lambda *_: 0.0)
    monkeypatch.setattr(KeepingRight, "past", lambda _self, place, _view: place)
    place = Place(15.0, 5.0, bend=(15.0, 5.0), gives_room=True)
    drives = Drives(prepared[model], place, Pose(5.0, 5.0, 0.0))
    moved = [not is_halt(drives.tick().command) for _ in range(stops + 1)]
    assert moved == [False] * stops + [True]
    again = Drives(prepared[model], place, Pose(5.0, 5.0, 0.0))
    moved = [not is_halt(again.tick(bumped=tick == 2).command) for tick in range(2 + stops)]
    assert not any(moved)


# --- Steer -----------------------------------------------------------------------------------------------------------


@settings(max_examples=60)
@given(
    first=st.floats(-9.0, 9.0), second=st.floats(-9.0, 9.0), x=st.floats(2, 20), y=st.floats(2, 13.5), data=st.data()
)
@pytest.mark.parametrize("model", MODELS)
def test_a_policy_that_steers_is_obeyed_as_far_as_walls_and_limits_allow(
    model: str, first: float, second: float, x: float, y: float, data: st.DataObject, prepared: dict[str, Prepared]
) -> None:
    wanted = command_of(model, first, second)
    pose = Pose(x, y, data.draw(st.floats(-3.0, 3.0)))
    drives = Drives(prepared[model], Steer(wanted, state="playing"), pose)
    decision = drives.tick()  # which checks walls and limits
    limited = wanted.limited(LIMITS)
    assert type(decision.command) is COMMANDS[model]
    if path_is_free(drives.terrain, pose, limited, STEP, RADIUS):
        assert decision.state == "playing"
        assert decision.command.numbers == pytest.approx(limited.numbers, abs=1e-6)
    else:
        assert decision.command.speed_mps < limited.speed_mps


def test_a_car_steered_into_a_wall_holds(prepared: dict[str, Prepared]) -> None:
    drives = Drives(prepared["car"], Steer(Drive(SPEED, 0.0)), Pose(10.0, 13.5, math.pi / 2))
    decision = drives.tick()
    assert (decision.command, decision.state) == (Drive(0.0, 0.0), State.HOLDING)


def test_a_holonomic_body_steered_into_a_wall_stops_at_it(prepared: dict[str, Prepared]) -> None:
    drives = Drives(prepared["holonomic"], Steer(Velocity(0.0, SPEED)), Pose(10.0, 13.5, 0.0))
    for _ in range(3):
        drives.tick()
    assert drives.pose.x == pytest.approx(10.0)
    assert drives.pose.y == pytest.approx(14.0, abs=1e-3)


@pytest.mark.parametrize(
    ("model", "command"),
    [("car", Velocity(1.0, 0.0)), ("differential", Drive(1.0, 0.0)), ("holonomic", Twist(1.0, 0.0))],
    ids=MODELS,
)
def test_another_models_command_is_a_failure(model: str, command: Command, prepared: dict[str, Prepared]) -> None:
    drives = Drives(prepared[model], Steer(command))
    with pytest.raises(PolicyFailed, match=rf"returned Steer\({type(command).__name__}\) for a .*; give a"):
        drives.tick()


# --- Stay and Bearing ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", MODELS)
def test_who_is_to_stay_stays(model: str, prepared: dict[str, Prepared]) -> None:
    drives = Drives(prepared[model], Stay("watching"))
    for _ in range(3):
        decision = drives.tick()
        assert type(decision.command) is COMMANDS[model]
        assert decision.command.numbers == (0.0, 0.0)
        assert (decision.state, decision.goal, decision.direction) == ("watching", None, None)


@pytest.mark.parametrize("model", MODELS)
def test_of_bearings_the_first_that_leads_on_is_taken(model: str, prepared: dict[str, Prepared]) -> None:
    pose = Pose(10.0, 13.9, 0.0)
    drives = Drives(prepared[model], Bearing((math.pi / 2, 0.0, math.pi), state="looking"), pose)
    decision = drives.tick()
    assert (decision.state, decision.direction) == ("looking", 0.0)
    assert drives.pose.x > 11.0


@pytest.mark.parametrize("model", MODELS)
def test_no_bearings_make_a_body_hold(model: str, prepared: dict[str, Prepared]) -> None:
    decision = Drives(prepared[model], Bearing(())).tick()
    assert (decision.command.numbers, decision.state) == ((0.0, 0.0), State.HOLDING)


def test_a_holonomic_body_stops_at_a_place_in_sight(prepared: dict[str, Prepared]) -> None:
    drives = Drives(prepared["holonomic"], Bearing((0.0,), near=(6.25, 5.75)))
    decision = drives.tick()
    assert decision.goal == decision.refined == (6.25, 5.75)
    assert (drives.pose.x, drives.pose.y) == pytest.approx((6.25, 5.75))


# --- off the ground --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(
    "pose", [Pose(27.0, 3.0, 0.0), Pose(-20.0, 3.0, 0.0), Pose(5.0, 15.25, 0.0)], ids=["chamber", "outside", "wall"]
)
@pytest.mark.parametrize("intent", [Place(5.0, 25.0), Bearing((0.0, 1.0)), Stay()], ids=lambda one: type(one).__name__)
def test_who_is_off_the_ground_holds(model: str, pose: Pose, intent: Intent, prepared: dict[str, Prepared]) -> None:
    mind = Drives(prepared[model], intent).mind
    decision = mind.step(at(0, pose), [])
    assert type(decision.command) is COMMANDS[model]
    assert decision.command.numbers == (0.0, 0.0)
    assert decision.state is State.HOLDING
    assert decision.goal is None


@pytest.mark.parametrize("model", MODELS)
def test_who_starts_beside_the_ground_joins_it(model: str, prepared: dict[str, Prepared]) -> None:
    """A body that its own point does not hold, but the free ground round it does."""
    reach = prepared[model].fields[1].reach
    terrain = prepared[model].terrain
    pose = Pose(10.1, 14.0, 0.0)
    assert not reach[terrain.point_at(pose.x, pose.y)]
    drives = Drives(prepared[model], Place(12.0, 8.0), pose)
    drives.until_near((12.0, 8.0), NEAR[model], IN_TIME[model])


# --- parking exactly -------------------------------------------------------------------------------------------------


BESIDE = [(12.25, 6.25), (9.75, 6.75), (6.25, 3.75), (10.25, 3.25)]
"""Centres of points beside a car, where no single step leads."""


@pytest.fixture(scope="module")
def fine() -> Prepared:
    """Points of 0.1 m, without walls."""
    scenario = load_scenario({"terrain": {"builtin": "open"}, "point": 0.1, "robots": {"count": 1, "model": "car"}})
    return prepared_on(scenario, Terrain("free", np.ones((125, 170), dtype=np.bool_), 0.1), [FIRST])


def heard_on(drives: Drives) -> tuple[int, int]:
    """The point on which others hear the robot."""
    heard = as_received(drives.pose)
    return drives.terrain.point_at(heard.x, heard.y)


def ends_on(drives: Drives, point: tuple[int, int], ticks: int, stays: int) -> None:
    for _ in range(ticks):
        drives.tick()
        if heard_on(drives) == point:
            break
    else:
        pytest.fail(f"it is at {drives.pose}")
    for _ in range(stays):
        drives.tick()
        assert heard_on(drives) == point


@pytest.mark.parametrize("spot", BESIDE)
def test_a_car_that_is_asked_to_ends_on_the_very_point_and_stays(spot: Spot, prepared: dict[str, Prepared]) -> None:
    drives = Drives(prepared["car"], Place(*spot, exact=True), Pose(10.0, 5.0, 0.0))
    ends_on(drives, drives.terrain.point_at(*spot), 80, 5)


@settings(max_examples=15)
@given(heading=st.floats(-3.1, 3.1), x=st.integers(35, 130), y=st.integers(35, 90))
def test_it_ends_where_others_hear_it_on_a_small_point(heading: float, x: int, y: int, fine: Prepared) -> None:
    """Others hear places rounded to centimetres, and what is seen from a place is computed from that."""
    drives = Drives(fine, Place(0.1 * x + 0.05, 0.1 * y + 0.05, exact=True), Pose(10.0, 5.0, heading))
    ends_on(drives, (y, x), 120, 1)


def test_without_being_asked_it_stays_beside_some_of_them(prepared: dict[str, Prepared]) -> None:
    beside = 0
    for spot in BESIDE:
        drives = Drives(prepared["car"], Place(*spot), Pose(10.0, 5.0, 0.0))
        for _ in range(80):
            drives.tick()
        beside += drives.terrain.point_at(drives.pose.x, drives.pose.y) != drives.terrain.point_at(*spot)
    assert beside > 0
