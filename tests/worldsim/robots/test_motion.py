"""Bodies in motion: whatever is commanded, nobody is ever inside a wall or another body, at any time of a step."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from patrol.ground.swept_path import advance, chords, lay_path
from patrol.ground.terrain import Terrain
from patrol.journal import Status
from patrol.pose import COMMANDS, MODELS, Command, Drive, Pose, Twist, Velocity, facing_of
from patrol.scenario import RobotSpec
from worldsim.kernels.collide import near_others
from worldsim.robots.bodies import Body, length, move, overlap, standstill, within_limits

STEP = 0.5
CAR = RobotSpec(1, "car", "car", 4.4, 0.6, 3.5, None)
DISC = RobotSpec(2, "disc", "holonomic", 4.4, 0.6, 3.5, None)
BASE = RobotSpec(3, "base", "differential", 4.4, 0.6, 3.5, None)
FIELD = Terrain("field", np.ones((16, 16), dtype=np.bool_), 0.5, (-2.0, -1.0))


def body(x: float, y: float, command: Command | None = None, spec: RobotSpec = DISC, heading: float = 0.0) -> Body:
    return Body(spec, Pose(x, y, heading), command or standstill(spec))


def clearance(terrain: Terrain, pose: Pose) -> float:
    """Distance (m) to the nearest blocked square or the edge; negative off the terrain."""
    xmin, ymin, xmax, ymax = terrain.bounds
    nearest = min(pose.x - xmin, xmax - pose.x, pose.y - ymin, ymax - pose.y)
    rows, cols = np.nonzero(terrain.blocked)
    away_x = np.abs(pose.x - xmin - (cols + 0.5) * terrain.point) - 0.5 * terrain.point
    away_y = np.abs(pose.y - ymin - (rows + 0.5) * terrain.point) - 0.5 * terrain.point
    return float(np.hypot(np.maximum(away_x, 0.0), np.maximum(away_y, 0.0)).min(initial=nearest))


def worst(terrain: Terrain, poses: Sequence[Pose], radii: Sequence[float]) -> float:
    """The room that is left where it is tightest, m; negative in an overlap."""
    room = [clearance(terrain, pose) - radius for pose, radius in zip(poses, radii, strict=True)]
    for i, one in enumerate(poses):
        for j, other in enumerate(poses[:i]):
            room.append(math.hypot(one.x - other.x, one.y - other.y) - radii[i] - radii[j])
    return min(room)


numbers = st.floats(-10, 10) | st.floats()
commands = st.one_of(*(st.builds(command, numbers, numbers) for command in (Velocity, Drive, Twist)))
specs = st.builds(
    lambda model, radius, turn: RobotSpec(1, "r", model, 4.4, radius, turn, None),
    st.sampled_from(MODELS),
    st.floats(0.1, 0.9),
    st.floats(0.5, 4.0),
)
places = st.builds(Pose, st.floats(-2, 6), st.floats(-1, 7), st.floats(-math.pi, math.pi))
walls = st.lists(st.tuples(st.integers(0, 15), st.integers(0, 15)), max_size=8)


FOUND = (Phase.explicit, Phase.reuse, Phase.generate)
"""A scene is shown as found: making one smaller takes longer than a test may."""


@st.composite
def scenes(draw: st.DrawFn) -> tuple[Terrain, list[Body]]:
    """A terrain with some obstacles and the bodies that fit out of eight, some of them dead."""
    passable = np.ones((16, 16), dtype=np.bool_)
    for row, col in draw(walls):
        passable[row, col] = False
    terrain = replace(FIELD, passable=passable)
    statuses = st.sampled_from([Status.ALIVE] * 3 + [Status.DEAD])
    bodies: list[Body] = []
    for spec, pose, status in draw(st.lists(st.tuples(specs, places, statuses), min_size=8, max_size=8)):
        apart = [math.hypot(pose.x - b.pose.x, pose.y - b.pose.y) - spec.radius - b.spec.radius for b in bodies]
        if min([clearance(terrain, pose) - spec.radius, *apart]) >= 0:
            bodies.append(Body(spec, pose, standstill(spec), status))
    return terrain, bodies


@settings(max_examples=150, phases=FOUND)
@given(scenes(), st.lists(st.lists(commands, min_size=8, max_size=8), min_size=1, max_size=3))
def test_no_body_ever_enters_a_wall_or_another_body(
    scene: tuple[Terrain, list[Body]], orders: list[list[Command]]
) -> None:
    terrain, bodies = scene
    radii = [one.spec.radius for one in bodies]
    for order in orders:
        for one, command in zip(bodies, order, strict=False):
            one.command = within_limits(one.spec, command) or standstill(one.spec)
        before = [one.pose for one in bodies]
        move(bodies, terrain, STEP)
        for part in np.linspace(0.0, 1.0, 9):
            poses = [
                one.pose if one.pose == start else advance(start, one.command, part * STEP)
                for one, start in zip(bodies, before, strict=True)
            ]
            # Arcs are swept as chords, which lie within 0.1 mm of them.
            assert not bodies or worst(terrain, poses, radii) > -3e-4
        assert not bodies or worst(terrain, [one.pose for one in bodies], radii) > -1e-8


@settings(max_examples=100, phases=FOUND)
@given(scenes(), st.lists(commands, min_size=8, max_size=8), st.permutations(range(8)))
def test_the_outcome_does_not_depend_on_the_order_of_the_bodies(
    scene: tuple[Terrain, list[Body]], order: list[Command], shuffle: list[int]
) -> None:
    terrain, bodies = scene
    for one, command in zip(bodies, order, strict=False):
        one.command = within_limits(one.spec, command) or standstill(one.spec)
    copies = [replace(one) for one in bodies]
    move(bodies, terrain, STEP)
    move([copies[i] for i in shuffle if i < len(copies)], terrain, STEP)
    assert copies == bodies


@given(commands)
def test_commands_are_cut_to_what_a_robot_can_do(command: Command) -> None:
    for spec in (CAR, DISC, BASE):
        obeyed = within_limits(spec, command)
        finite = all(math.isfinite(number) for number in (*command.numbers, facing_of(command) or 0.0))
        assert (obeyed is not None) == (finite and type(command) is COMMANDS[spec.model])
        if isinstance(obeyed, Drive):
            assert abs(obeyed.speed) <= spec.speed
            assert abs(obeyed.curvature) <= 1 / spec.turning_radius
        elif isinstance(obeyed, Velocity) and isinstance(command, Velocity):
            assert math.hypot(obeyed.vx, obeyed.vy) <= spec.speed * (1 + 1e-12)
            if math.hypot(command.vx, command.vy) <= spec.speed * (1 - 1e-12):
                assert obeyed == command
        elif isinstance(obeyed, Twist):
            for side in (-1, 1):
                assert abs(obeyed.speed + side * obeyed.turn_rate * spec.radius) <= spec.speed * (1 + 1e-12)


@given(st.lists(st.builds(Drive, numbers, numbers), max_size=12), places)
def test_a_car_never_turns_tighter_than_its_radius(drives: list[Drive], start: Pose) -> None:
    car = Body(CAR, start, standstill(CAR))
    terrain = Terrain("wide", np.ones((60, 60), dtype=np.bool_), 2.0, (-60.0, -60.0))
    for drive in drives:
        car.command = within_limits(CAR, drive) or standstill(CAR)
        before = car.pose
        move([car], terrain, STEP)
        turn = abs(math.remainder(car.pose.heading - before.heading, math.tau))
        chord = math.hypot(car.pose.x - before.x, car.pose.y - before.y)
        assert chord >= 2 * CAR.turning_radius * math.sin(turn / 2) - 1e-9


def test_a_turn_on_the_spot_is_never_cancelled_and_does_not_count_as_driving() -> None:
    spinning, runner = body(2.0, 0.0, Twist(0.0, 7.0), BASE), body(0.0, 0.0, Velocity(4.0, 0.0))
    move([spinning, runner], FIELD, STEP)
    assert spinning.pose == Pose(2.0, 0.0, 3.5 - math.tau)
    assert (spinning.bumped, spinning.collisions, spinning.distance_m) == (False, 0, 0.0)
    assert (runner.bumped, runner.pose.x) == (True, 0.0)


def test_who_touches_a_wall_turns_on_the_spot_and_drives_along_it() -> None:
    base = body(-1.4, 3.0, Twist(0.0, -math.pi), BASE)  # the terrain ends at x = -2
    move([base], FIELD, STEP)
    assert base.pose == Pose(-1.4, 3.0, -math.pi / 2)
    base.command = Twist(1.0, 0.0)
    move([base], FIELD, STEP)
    assert not base.bumped
    assert (base.pose.x, base.pose.y) == pytest.approx((-1.4, 2.5))
    base.command = Twist(1.0, -1.0)
    move([base], FIELD, STEP)
    assert base.bumped


@pytest.mark.parametrize(("speed", "gap_m"), [(2.0, 2.0), (4.0, 2.0), (8.0, 4.0)])
def test_two_robots_head_on_both_stay_and_cannot_swap(speed: float, gap_m: float) -> None:
    fast = replace(DISC, speed=8.0)
    left, right = body(0.0, 0.0, Velocity(speed, 0.0), fast), body(gap_m, 0.0, Velocity(-speed, 0.0), fast)
    move([left, right], FIELD, STEP)
    assert (left.pose, right.pose) == (Pose(0.0, 0.0, 0.0), Pose(gap_m, 0.0, 0.0))
    assert left.bumped
    assert right.bumped
    assert (left.collisions, right.collisions, left.distance_m) == (1, 1, 0.0)


def test_robots_that_cross_at_different_times_both_pass() -> None:
    first, second = body(0.0, 0.0, Velocity(4.0, 0.0)), body(2.0, -1.3, Velocity(0.0, 0.2))
    move([first, second], FIELD, STEP)
    assert not first.bumped
    assert not second.bumped


def test_a_convoy_moves_as_one() -> None:
    convoy = [body(1.2 * i, 0.0, Velocity(1.0, 0.0)) for i in range(4)]
    move(convoy, FIELD, STEP)
    assert [one.pose.x for one in convoy] == pytest.approx([0.5, 1.7, 2.9, 4.1])


def test_a_blocked_robot_blocks_those_behind_it() -> None:
    passable = np.ones((16, 16), dtype=np.bool_)
    passable[:, 14] = False  # x from 5.0 to 5.5
    wall = replace(FIELD, passable=passable)
    queue = [body(4.4 - 1.2 * i, 0.0, Velocity(1.0, 0.0)) for i in range(4)]
    aside = body(0.0, 4.0, Velocity(1.0, 0.0))
    move([*queue, aside], wall, STEP)
    assert [one.pose.x for one in queue] == [4.4 - 1.2 * i for i in range(4)]
    assert all(one.bumped for one in queue)
    assert aside.pose.x == 0.5


@pytest.mark.parametrize("status", [Status.ALIVE, Status.DEAD, Status.LOST, Status.LEFT, Status.ABSENT])
def test_a_standing_or_dead_body_is_in_the_way_and_one_that_left_is_not(status: Status) -> None:
    passes = status in (Status.LEFT, Status.ABSENT)
    robot, other = body(0.0, 0.0, Velocity(4.0, 0.0)), body(2.0, 0.0)
    other.status = status
    move([robot, other], FIELD, STEP)
    assert (robot.pose.x == 2.0) == passes
    assert (robot.bumped, robot.collisions) == (not passes, not passes)
    assert (other.pose.x, other.collisions, other.bumped) == (2.0, 0, False)


@pytest.mark.parametrize(("beside", "bumps"), [((1.0, 0.81), False), ((1.0, 0.79), True), ((2.75, 0.0), True)])
def test_bodies_of_unequal_size_meet_at_the_sum_of_their_radii(beside: tuple[float, float], bumps: bool) -> None:
    """Halfway, and only where the move ends: 2 m along x, of radii 0.2 and 0.6 m."""
    small, large = Body(replace(DISC, radius=0.2), Pose(0.0, 0.0, 0.0), Velocity(4.0, 0.0)), body(*beside)
    for robots in ([small, large], [large, small]):
        small.pose, small.command = Pose(0.0, 0.0, 0.0), Velocity(4.0, 0.0)
        move(robots, FIELD, STEP)
        assert (small.bumped, small.pose.x) == (bumps, 0.0 if bumps else 2.0)


def test_two_that_overlap_do_not_move_on_together() -> None:
    robots = [body(0.0, 0.0, Velocity(0.0, 1.0)), body(1.0, 0.0, Velocity(0.0, 1.0))]
    move(robots, FIELD, STEP)
    assert [robot.pose.y for robot in robots] == [0.0, 0.0]


@pytest.mark.parametrize(("speeds", "xs"), [((-1.0, 1.0), (-0.5, 1.5)), ((1.0, -0.5), (0.0, 1.0))])
def test_two_that_overlap_may_only_move_apart(speeds: tuple[float, float], xs: tuple[float, float]) -> None:
    left, right = body(0.0, 0.0, Velocity(speeds[0], 0.0)), body(1.0, 0.0, Velocity(speeds[1], 0.0))
    move([left, right], FIELD, STEP)
    assert (left.pose.x, right.pose.x) == xs


def test_cars_on_arcs_meet_too() -> None:
    # Two cars on the same circle, driving towards each other from a quarter turn either side.
    half = CAR.speed * STEP / CAR.turning_radius
    centre, radius = (3.0, 0.0), CAR.turning_radius
    cars = []
    for side in (-1, 1):
        angle = math.pi / 2 + side * half
        place = (centre[0] + radius * math.cos(angle), centre[1] + radius * math.sin(angle))
        cars.append(Body(CAR, Pose(*place, angle - side * math.pi / 2), Drive(CAR.speed, -side / radius)))
    before = [car.pose for car in cars]
    move(cars, FIELD, STEP)
    assert [car.pose for car in cars] == before


@given(st.lists(st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(0, 2)), max_size=12))
def test_the_bodies_that_can_meet_are_those_whose_discs_overlap(discs: list[tuple[float, float, float]]) -> None:
    discs.sort()
    found = near_others(np.array(discs, dtype=np.float64).reshape(-1, 3))

    def overlap(one: tuple[float, float, float], other: tuple[float, float, float]) -> bool:
        return math.hypot(other[0] - one[0], other[1] - one[1]) <= one[2] + other[2]

    expected = [any(overlap(one, other) for other in discs[:at] + discs[at + 1 :]) for at, one in enumerate(discs)]
    assert found.tolist() == expected


def test_who_is_far_away_changes_nothing_for_those_who_meet() -> None:
    pair = [(0.0, 0.0, Velocity(4.0, 0.0)), (2.0, 0.5, Velocity(-4.0, 0.3))]
    alone, among = [body(*one) for one in pair], [body(*one) for one in pair]
    far = body(4.5, 5.5, Velocity(0.0, -0.5))
    move(alone, FIELD, STEP)
    move([among[0], far, among[1]], FIELD, STEP)
    assert [one.pose for one in among] == [one.pose for one in alone]
    assert (far.pose.y, [one.collisions for one in among]) == (5.25, [1, 1])


def test_bodies_meet_as_if_the_paths_of_all_were_laid(monkeypatch: pytest.MonkeyPatch) -> None:
    """A car on a narrow arc, far from all others, sets into how many chords everybody's arcs are divided."""
    pair = [(0.0, 0.0, Drive(4.0, 0.15), CAR), (3.2, 0.1, Drive(-4.0, 0.2), CAR)]
    bodies = [body(*one) for one in [*pair, (20.0, 20.0, Drive(4.4, 0.28), CAR)]]
    pieces = max(chords(one.command, STEP) for one in bodies)
    assert pieces > max(chords(one.command, STEP) for one in bodies[:2]), "the far one is cut finer"
    due = np.empty((2, pieces + 1, 2))
    for path, one in zip(due, bodies[:2], strict=True):
        lay_path(path, one.pose, one.command, STEP)
    laid = []
    monkeypatch.setattr("worldsim.robots.bodies.cancel_meeting", lambda paths, *_: laid.append(paths.copy()))
    move(bodies, Terrain("wide", np.ones((60, 60), dtype=np.bool_), 0.5, (-2.0, -1.0)), STEP)
    assert len(laid) == 1
    assert np.array_equal(laid[0], due)


def test_distances_add_up() -> None:
    car = body(0.0, 0.0, Drive(-1.0, 0.2), CAR)
    driven = 0.0
    for speed in (-1.0, 2.0, 0.0, 4.4):
        car.command = Drive(speed, 0.2)
        move([car], FIELD, STEP)
        driven += 0.0 if car.bumped else length(car.command, STEP)
    assert car.distance_m == driven > 0.0


def test_a_body_that_is_stopped_forgets_its_command_and_how_long_it_heard_none() -> None:
    stopped = body(1.0, 1.0, Velocity(1.0, 0.0))
    stopped.silent_s, stopped.bumped = 3.0, True
    stopped.halt(Status.PAUSED)
    assert (stopped.status, stopped.command, stopped.bumped) == (Status.PAUSED, standstill(DISC), False)
    assert stopped.silent_s == 0.0


@pytest.mark.parametrize(("radius", "other"), [(0.5, 0.25), (0.25, 0.5), (0.375, 0.375)])
def test_bodies_overlap_below_the_sum_of_their_radii(radius: float, other: float) -> None:
    for apart, expected in ((0.0, True), (math.nextafter(0.75, 0.0), True), (0.75, False), (0.76, False)):
        for place in (Pose(apart, 0.0, 3.0), Pose(0.0, -apart, 0.0)):
            assert overlap(Pose(0.0, 0.0, 0.0), radius, place, other) is expected


@pytest.mark.parametrize(
    ("beside", "bumps"), [(1.2, False), (1.2 - 1e-10, False), (1.2 - 1e-7, True), (1.2 - 1e-4, True)]
)
def test_bodies_pass_each_other_where_they_only_touch(beside: float, bumps: bool) -> None:
    """Radii of 0.6 m; a billionth of a metre is rounding."""
    bodies = [body(0.0, 2.0, Velocity(4.0, 0.0)), body(1.0, 2.0 + beside, spec=replace(DISC, number=3))]
    move(bodies, FIELD, STEP)
    assert [one.bumped for one in bodies] == [bumps, False]
    assert bodies[0].pose.x == (0.0 if bumps else 2.0)
