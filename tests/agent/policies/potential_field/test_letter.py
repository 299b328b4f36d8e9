"""The paper to the letter: each of its rules that replaces one of ours changes what a robot does."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from agent.belief.dilated import Dilated
from agent.belief.posts import Posts
from agent.bodies.base import GoalFinder
from agent.bodies.car import Unstuck
from agent.bodies.steering import CarSteering
from agent.build import Shared, build_mind
from agent.policies.potential_field import Pull
from agent.ports import Bearing, Decision, Intent, Place, Policy, State, Stay
from agent.psi import psi_field
from agent.routes.ground import Ground
from agent.routes.path_window import CENTRE, Aside
from agent.view import View
from fogwatch.inprocess import run_in_process
from fogwatch.run_options import preset_settings
from patrol.ground.fog import AGELESS, Fog
from patrol.ground.swept_path import advance
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.pose import Pose
from patrol.scenario import BodyLengths, RobotSpec, load_scenario, open_scenario
from patrol.scenario.policies import PaperRule
from tests.agent.minds import at, fields_of, prepared_on, pull_on

CAR = RobotSpec(1, "r1", "car", 4.4, 1.0, 3.5, None)


# --- the direction of a force -----------------------------------------------------------------------------------------


def pull_of(*places: tuple[int, int], **options: Any) -> Pull:
    """The forces on a robot in the middle of an open field of 20 x 20 m where some points (row, col) are stale."""
    seen = np.full((41, 41), 100, dtype=np.int32)
    for place in places:
        seen[place] = 0
    return pull_on(fields_of(np.ones((41, 41), dtype=np.bool_)), (21, 21), seen, **{"direction": "vector", **options})


def direction(pull: Pull) -> float:
    return math.degrees(math.atan2(pull.sums[1], pull.sums[0]))


def test_a_force_takes_one_of_the_eight_first_steps() -> None:
    place = 24, 30  # 4 up, 10 across
    ours, printed = pull_of(place), pull_of(place, letter="first-step")
    assert direction(ours) == pytest.approx(math.degrees(math.atan2(4, 10)), abs=0.1)
    assert direction(printed) == pytest.approx(45.0, abs=0.1)
    assert ours.bend == (25, 31)
    assert printed.bend == (22, 22)


@pytest.mark.parametrize(("place", "degrees"), [((20, 30), 0), ((30, 20), 90), ((10, 10), -135), ((20, 10), 180)])
def test_a_path_along_one_of_the_eight_directions_begins_with_it(place: tuple[int, int], degrees: float) -> None:
    for letter in (False, "first-step"):
        assert abs(direction(pull_of(place, letter=letter))) == pytest.approx(abs(degrees), abs=0.1)


@pytest.mark.parametrize(("ties", "degrees"), [("diagonal", 45.0), ("straight", 0.0)])
def test_ties_decide_which_of_equally_long_paths_counts(ties: str, degrees: float) -> None:
    assert direction(pull_of((24, 30), letter="first-step", ties=ties)) == pytest.approx(degrees, abs=0.1)


def test_drawn_ties_favour_no_direction() -> None:
    """On a field of equal points half of them lie nearer to a diagonal than to a row or column."""
    options: dict[str, Any] = {"letter": "first-step", "direction": "mode", "fow": "f1", "distance": "g1"}
    everywhere = [(row, col) for row in range(41) for col in range(41)]
    keys = {"diagonal": 0, "straight": 0, "drawn": 5}
    shares = {ties: pull_of(*everywhere, ties=ties, key=key, **options).sums for ties, key in keys.items()}
    diagonal = {ties: sums[1::2].sum() / sums.sum() for ties, sums in shares.items()}
    assert diagonal["diagonal"] > 0.85
    assert diagonal["straight"] < 0.15
    assert diagonal["drawn"] == pytest.approx(0.5, abs=0.1)
    drawn = {key: direction(pull_of((24, 30), letter="first-step", ties="drawn", key=key)) for key in range(64)}
    assert set(np.round(list(drawn.values()))) == {0.0, 45.0}
    assert drawn[7] == direction(pull_of((24, 30), letter="first-step", ties="drawn", key=7))


def test_the_lengths_stay_the_same() -> None:
    place = 24, 30
    for ties in ("diagonal", "straight", "drawn"):
        assert pull_of(place).sums[2] == pull_of(place, letter="first-step", ties=ties).sums[2]


@pytest.mark.parametrize("beside", [(0.1, 0.3), (-0.45, 0.2), (-0.3, -0.1)])
@pytest.mark.parametrize("direction_by", ["vector", "mode"])
def test_fresh_points_pull_a_robot_beside_the_centre_of_its_point(direction_by: str, beside: Aside) -> None:
    """g3 falls within a point, so that what the nearest ones leave counts."""
    options: dict[str, Any] = {"paths": "straight", "fow": "f4", "distance": "g3", "direction": direction_by}
    centre, aside = (pull_of(aside=aside, **options).sums for aside in (CENTRE, beside))
    offsets = [(row - 20.0, col - 20.0) for row in range(41) for col in range(41) if (row, col) != (20, 20)]
    sums = np.zeros(2 if direction_by == "vector" else 8)
    for up, across in ((up - beside[0], across - beside[1]) for up, across in offsets):
        force = math.exp(-0.2 * round(100.0 * math.hypot(up, across)) / 100.0 * 5.0)
        bearing = math.atan2(up, across)
        if direction_by == "vector":
            sums += force * math.cos(bearing), force * math.sin(bearing)
        else:
            sums[math.floor(bearing / (math.pi / 4) + 0.5) % 8] += force
    assert aside[: sums.size] == pytest.approx(sums, rel=1e-9, abs=1e-12)
    left = math.hypot(*aside[:2]) if direction_by == "vector" else aside.max() - np.sort(aside)[-2]
    assert left > 0.1
    nothing = math.hypot(*centre[:2]) if direction_by == "vector" else np.ptp(centre[::2])
    assert nothing == pytest.approx(0.0, abs=1e-9)


# --- what the policy asks for, and what the body makes of it ---------------------------------------------------------


class Listening:
    """A policy that remembers the answers of another."""

    def __init__(self, policy: Policy) -> None:
        self.policy = policy
        self.intents: list[Intent] = []

    def decide(self, view: View) -> Intent:
        self.intents.append(self.policy.decide(view))
        return self.intents[-1]


def hall() -> BoolGrid:
    """30 x 20 m with a wall along x in [15, 16) that ends 5 m from the upper edge."""
    passable = np.ones((40, 60), dtype=np.bool_)
    passable[:30, 30:32] = False
    return passable


def decided(
    letter: Any, pose: Pose, *, ticks: int = 1, contacts: tuple[tuple[float, float], ...] = (), **settings: Any
) -> tuple[Intent, Decision]:
    """The last answer of the policy of a robot that stands still in the hall, and the body's."""
    options = {"letter": letter, "random_move": 0.0, **settings.pop("options", {})}
    patrol = {"policy": "potential-field", "options": options, **settings}
    mapping = {"terrain": {"builtin": "open"}, "point": 0.5, "robots": {"count": 2, "model": "holonomic"}}
    scenario = load_scenario({**mapping, "sensor": {"range": 6.0}, "patrol": patrol, "intruders": [{"place": [5, 5]}]})
    mind = build_mind(Shared(prepared_on(scenario, Terrain("hall", hall(), 0.5), [pose, pose])), 1)
    mind.policy = policy = Listening(mind.policy)
    decision = [mind.step(at(k, pose, contacts=contacts), []) for k in range(ticks)][-1]
    return policy.intents[-1], decision


def test_the_strongest_direction_is_the_only_one_that_is_tried() -> None:
    """Straight paths pull into the wall, which is closer than half a step."""
    straight: dict[str, Any] = {"options": {"paths": "straight", "dilatation": 0}, "avoidance": "none"}
    pose = Pose(13.75, 5.25, 0.0)
    (ours, _), (printed, stuck) = (decided(letter, pose, ticks=40, **straight) for letter in (False, "one-direction"))
    assert isinstance(ours, Bearing)
    assert isinstance(printed, Bearing)
    assert len(ours.bearings) > 1
    assert printed.bearings == tuple(ours.bearings[:1])
    assert printed.bend is None
    assert stuck.direction == printed.bearings[0]


def test_a_robot_does_not_stop_at_a_stale_place_close_by() -> None:
    """Behind the wall all is stale, and the way round it is short."""
    pose = Pose(15.25, 16.25, 0.0)
    ours, _ = decided(False, pose, ticks=40)
    printed, _ = decided("no-stop", pose, ticks=40)
    assert isinstance(ours, Bearing)
    assert isinstance(printed, Bearing)
    assert ours.near is not None
    assert printed.near is None
    assert printed.bearings == ours.bearings


def goal_of(*rules: PaperRule, bearing: float = 0.0, refined: bool = True) -> tuple[tuple[float, float], ...]:
    """The goal before and after refinement of a robot that stands 2.75 m before the wall of the hall."""
    terrain = Terrain("hall", hall(), 0.5)
    psi = psi_field(terrain, 10.0) if refined else None
    goal = GoalFinder(BodyLengths(), Ground(terrain, hall()), psi, rules).along(bearing, 11, 25)
    return goal.goal, goal.refined


def test_a_goal_may_lie_behind_a_wall() -> None:
    assert goal_of(refined=False) == ((14.75, 5.25), (14.75, 5.25))
    assert goal_of("far-goal", refined=False) == ((17.75, 5.25), (17.75, 5.25))


def test_a_goal_may_lie_beyond_the_terrain() -> None:
    for rules in (("far-goal",), ("far-goal", "whole-square")):
        goal, refined = goal_of(*rules, bearing=-math.pi / 2)
        assert goal == (12.25, -0.25)
        assert (refined == goal) == (rules == ("far-goal",))


def test_refinement_considers_the_whole_square() -> None:
    goal, ours = goal_of()
    same, printed = goal_of("whole-square")
    assert goal == same == (14.75, 5.25)
    psi = psi_field(Terrain("hall", hall(), 0.5), 10.0)
    row, col = 10, 29
    least = psi[row - 2 : row + 3, col - 2 : col + 3].min()
    assert psi[int(printed[1] * 2), int(printed[0] * 2)] == least
    assert psi[int(ours[1] * 2), int(ours[0] * 2)] >= least
    behind = goal_of("far-goal", "whole-square")[1]
    assert behind[0] > 16.0


@pytest.mark.parametrize("reach", [1, 3, 16])
def test_staleness_fills_a_square_through_walls(reach: int) -> None:
    ground, proxy = hall(), np.full((40, 60), -1, dtype=np.int32)
    fog = Fog(ground)
    fog.last_seen[ground] = 9
    fog.last_seen[10, 28] = 2  # left of the wall
    seen = {}
    for square in (False, True):
        dilated = Dilated(fog, ground, Posts(proxy), reach, square=square)
        dilated.within((0, 39, 0, 59), 10)
        dilated.changed([(0, 39, 0, 59)])
        seen[square] = dilated.within((0, 39, 0, 59), 10)
    rows, cols = np.indices(ground.shape)
    window = (abs(rows - 10) <= reach) & (abs(cols - 28) <= reach)
    expected = np.where(ground, np.where(window, 2, 9), AGELESS)
    assert np.array_equal(seen[True], expected)
    assert np.array_equal(seen[False], np.where(ground & (cols > 31), 9, expected))


def test_getting_unstuck_as_printed_takes_the_same_steps_each_time() -> None:
    terrain = Terrain("field", np.ones((120, 120), dtype=np.bool_), 0.5)
    unstuck = Unstuck(CarSteering(CAR, terrain, 0.5), CAR.speed)
    for _ in range(8):
        pose, steps = Pose(30.0, 30.0, 0.0), 0
        unstuck.begin(0.0)
        while (drive := unstuck.step(pose, bumped=False)) is not None:
            pose = advance(pose, drive, 0.5)
            steps += 1
        assert steps == 1
    unstuck.begin(math.pi)
    speeds = [unstuck.step(Pose(30.0, 30.0, 0.0), bumped=k > 0) for k in range(40)]
    assert [drive.speed < 0.0 for drive in speeds if drive is not None] == [k % 2 == 0 for k in range(len(speeds))]


def test_cars_get_unstuck_as_printed_where_ties_are_drawn() -> None:
    """If all paths begin diagonally that can, they drive to and fro before the same wall."""

    def dead_end_share(ties: str) -> float:
        size = {"point": 1.0, "duration": 300, "seed": 2, "robots.count": 3, "robots.model": "car"}
        rules = {"patrol.avoidance": "none", "patrol.options.dilatation": 0, "patrol.options.ties": ties}
        scenario = open_scenario("clutter", {**preset_settings("letter"), **size, **rules})
        robots = run_in_process(scenario, verify_fog=False).summary.robots.values()
        return sum(robot.dead_end_share or 0.0 for robot in robots) / len(robots)

    assert dead_end_share("drawn") < 0.5 * dead_end_share("diagonal")


def test_forces_alone_surround_an_intruder() -> None:
    pose, intruder = Pose(13.25, 15.25, 0.0), (2.25, 15.25)
    ours, _ = decided(False, pose, contacts=(intruder,))
    printed, decision = decided("surround-forces", pose, contacts=(intruder,))
    assert isinstance(ours, Place)
    assert isinstance(printed, Bearing)
    assert len(printed.bearings) == 1
    assert abs(printed.bearings[0]) == pytest.approx(math.pi, abs=0.05)
    assert decision.state == State.SURROUNDING
    inside, _ = decided("surround-forces", Pose(5.25, 15.25, 0.0), contacts=(intruder,))
    assert inside == Stay(State.SURROUNDING)
