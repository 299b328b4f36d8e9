"""Manoeuvres of cars and differential robots: three-point turns, ways out in reverse, ways round what is closed."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from agent.bodies.manoeuvre import _paths_to, wheel_moves
from agent.kernels.manoeuvre import KEPT, _fits, _is_free, _measure, search
from agent.kernels.wave import FAR
from agent.ports import Place, State
from agent.routes.ground import Ground, Spot
from patrol.ground.swept_path import advance, path_is_free
from patrol.ground.terrain import Terrain
from patrol.pose import Drive, Pose, Twist, wrap
from patrol.radio.message import CM_PER_M, as_received
from patrol.scenario import RobotSpec
from tests.agent.minds import STEP
from tests.agent.plans import Robots, plan, prepared_in

# Not the product's own, so that a wrong one there is noticed.
MOST_ARCS = 256
CLEARANCE = 1e-3

RADIUS, TURNING, SPEED = 0.5, 1.0, 1.0
SPEC = RobotSpec(1, "r1", "differential", SPEED, RADIUS, TURNING, None)
CAR = {"model": "car", "radius": RADIUS, "turning_radius": TURNING, "speed": SPEED}


def car(terrain: Terrain, pose: Pose, place: Spot, start: Pose | None = None, **patrol: object) -> Robots:
    """A car that is to go to a place; ``start`` is where its reachable ground begins, unless that is its pose."""
    prepared = prepared_in(terrain, [start or pose], CAR, patrol=patrol, sensor={"range": 3.0})
    return Robots(prepared, Place(*place), at_poses=[pose])


def dead_end(width: float) -> Terrain:
    """A room of 6 x 6 m, and a corridor of 8 m that leads out of it and ends."""
    low = 3.0 - 0.5 * width
    return plan((14.0, 6.0), (0.0, 0.0, 6.0, 6.0), (6.0, low, 14.0, low + width))


def test_kept_paths_reach_no_farther_than_asked() -> None:
    terrain = dead_end(3.0)
    kept, point = Ground(terrain, terrain.free), (terrain.height // 2, 5)
    for within in (12.0, 2.0, 5.0, 12.0):
        paths, fresh = (_paths_to(point, ground, within) for ground in (kept, Ground(terrain, terrain.free)))
        assert paths.limit == fresh.limit
        for row, col in np.ndindex(terrain.shape):
            assert paths.length_to(row, col) == fresh.length_to(row, col)


@pytest.mark.parametrize("heading", [0.0, math.pi, 0.3])
def test_it_leaves_a_corridor_of_2_6_radii_in_which_it_cannot_turn(heading: float) -> None:
    robots = car(dead_end(2.6 * RADIUS + 0.1), Pose(13.0, 3.0, heading if heading != 0.3 else 0.0), (2.0, 3.0))
    robots.until_near((2.0, 3.0), 0.8, 80)
    assert robots.bodies[0].collisions == 0


@pytest.mark.parametrize("width", [3.0, 3.6, 4.2])
def test_it_turns_round_in_a_corridor_by_three_points(width: float) -> None:
    """It has to pass the bend at the corridor's other end with its nose, or in reverse, and comes there either way."""
    terrain = plan((14.0, 8.0), (0.0, 0.0, 14.0, width), (0.0, 0.0, 3.0, 8.0))
    robots = car(terrain, Pose(12.0, 0.5 * width, 0.0), (1.5, 7.0))
    states, reverse = set(), 0
    for _ in range(120):
        (decision,) = robots.tick()
        states.add(decision.state)
        reverse += decision.command.numbers[0] < 0.0
        if robots.apart((1.5, 7.0)) < 0.8:
            break
    assert robots.apart((1.5, 7.0)) < 0.8
    assert states == {State.PATROLLING}
    assert reverse > 0


@pytest.mark.parametrize(
    ("model", "within", "ticks"), [("car", 0.8, 80), ("holonomic", 0.1, 60), ("differential", 0.1, 60)]
)
def test_it_backs_out_of_a_dead_end_as_wide_as_its_body(model: str, within: float, ticks: int) -> None:
    prepared = prepared_in(dead_end(2.0 * RADIUS), [Pose(3.0, 3.0, 0.0)], {**CAR, "model": model})
    robots = Robots(prepared, Place(2.0, 3.0), at_poses=[Pose(9.0, 3.0, 0.0)])
    robots.until_near((2.0, 3.0), within, ticks)


def test_without_manoeuvres_it_stays_there() -> None:
    terrain = dead_end(2.0 * RADIUS)
    robots = car(terrain, Pose(9.0, 3.0, 0.0), (2.0, 3.0), start=Pose(3.0, 3.0, 0.0), manoeuvres=False)
    for _ in range(20):
        (decision,) = robots.tick()
        assert (decision.command, decision.state) == (Drive(0.0, 0.0), State.HOLDING)


def test_the_same_inputs_give_the_same_commands() -> None:
    runs = []
    for _ in range(2):
        robots = car(dead_end(1.4), Pose(13.0, 3.0, 0.0), (2.0, 1.0))
        runs.append([robots.tick() for _ in range(40)])
    assert runs[0] == runs[1]


def test_bumped_again_and_again_it_backs_off() -> None:
    robots = car(plan((14.0, 8.0), (0.0, 0.0, 14.0, 8.0)), Pose(4.0, 4.0, 0.0), (12.0, 4.0))
    pose, commands, states = robots.bodies[0].pose, [], []
    for _ in range(40):
        (decision,) = robots.tick()
        commands.append(decision.command)
        states.append(decision.state)
        robots.bodies[0].pose, robots.bodies[0].bumped = pose, True
    assert states[0] == State.PATROLLING
    assert State.DEAD_END in states
    assert any(command.numbers[0] < 0.0 for command in commands)


def test_a_place_close_by_round_a_corner_is_reached() -> None:
    """The car neither parks nor swings where little of the way is left and a wall is in between."""
    terrain = plan((8.0, 8.0), (0.0, 0.0, 8.0, 3.8), (0.0, 4.2, 8.0, 8.0), (5.5, 3.8, 8.0, 4.2))
    robots = car(terrain, Pose(4.9, 3.0, 0.0), (5.0, 5.0))
    robots.until_near((5.0, 5.0), 0.8, 60)


@pytest.mark.parametrize(("point", "radius", "speed"), [(0.5, 0.15, 0.2), (0.5, 0.2, 0.5), (0.25, 0.1, 0.2)])
def test_a_small_slow_robot_gets_across_a_hall_of_large_points(point: float, radius: float, speed: float) -> None:
    terrain = Terrain("hall", np.ones((round(10.0 / point), round(10.0 / point)), dtype=np.bool_), point)
    body = {"model": "differential", "radius": radius, "speed": speed}
    robots = Robots(prepared_in(terrain, [Pose(1.1, 1.2, 2.5)], body), Place(8.6, 8.3))
    robots.until_near((8.6, 8.3), 0.5 * point, round(1.5 * math.dist((1.1, 1.2), (8.6, 8.3)) / (speed * STEP)))


def test_a_differential_robot_that_sees_ahead_only_does_not_reverse() -> None:
    both, ahead = (wheel_moves(SPEC, STEP, reverses=reverses).each for reverses in (True, False))
    assert any(move.arc[0] < 0.0 for move in both)
    assert [move for move in both if move.arc[0] >= 0.0] == ahead


@settings(max_examples=100)
@given(radius=st.floats(0.05, 2.0), speed=st.floats(0.05, 5.0), step=st.floats(0.05, 1.0))
def test_all_moves_are_within_the_limits_of_the_wheels(radius: float, speed: float, step: float) -> None:
    spec = replace(SPEC, radius=radius, speed=speed)
    for move in wheel_moves(spec, step, reverses=True).each:
        assert move.command.is_within(spec.limits)
        end = advance(Pose(0.0, 0.0, 0.0), move.command, move.ticks * step)
        length, curvature, turn, _ = move.arc
        assert end.heading == pytest.approx(wrap(length * curvature + turn), abs=1e-9)
        if length == 0.0:
            assert (end.x, end.y) == (0.0, 0.0)


# --- the search alone ------------------------------------------------------------------------------------------------


def cluttered(seed: int, point: float) -> Terrain:
    """8 x 8 m with ten blocks."""
    dice = np.random.default_rng(seed)
    size = round(8.0 / point)
    passable = np.ones((size, size), dtype=np.bool_)
    for _ in range(10):
        row, col = (int(place) for place in dice.integers(0, size, 2))
        high, wide = (int(extent) for extent in dice.integers(1, max(2, size // 8), 2))
        passable[row : row + high, col : col + wide] = False
    return Terrain("cluttered", passable, point)


ARCS = [(sign * share * 0.5, bend) for share in (1.0, 0.4) for sign in (1.0, -1.0) for bend in (0.0, 1.0, -1.0, 0.5)]
"""Lengths in m, and curvatures in 1/m."""

ON_THE_SPOT = (0.5, -0.5, 1.5, -1.5)
"""Turns, rad."""


MOST_NODES = 3000
BODIES: dict[str, Any] = {
    "seed": st.integers(0, 2**32 - 1),
    "point": st.sampled_from([0.1, 0.25, 0.5]),
    "radius": st.floats(0.2, 0.8),
    "heading": st.floats(-3.1, 3.1),
}


def heard_point(terrain: Terrain, pose: Pose) -> tuple[int, int]:
    """Return the point on which others hear a body."""
    heard = as_received(pose)
    return terrain.point_at(heard.x, heard.y)


def fits(terrain: Terrain, x: float, y: float, radius: float) -> bool:
    """Return True if a disc overlaps no blocked square of the whole grid."""
    grid = np.array([0, terrain.height - 1, 0, terrain.width - 1])
    return bool(_fits(terrain.blocked, terrain.point, *terrain.origin, x, y, radius, grid))


def found_in(
    terrain: Terrain, pose: Pose, left: np.ndarray, radius: float, *, turns: bool = False
) -> list[Drive | Twist]:
    """Return the commands, each for 1 s, of a search that ends 2 m nearer to the goal.

    Args:
        terrain: The map.
        pose: Where it begins.
        left: float64 (h, w), the way left from each point, m.
        radius: Of the body, m.
        turns: Whether the body turns on the spot, too.
    """
    found = np.zeros(MOST_ARCS, dtype=np.int64)
    nothing = np.zeros((0, 0), dtype=np.uint8)
    hundredths, limit = np.rint(left * (100.0 / terrain.point)), round(100.0 * 100.0 / terrain.point)
    lengths = np.where(hundredths <= limit, hundredths, FAR).astype(np.int32)
    first = float(hundredths[heard_point(terrain, pose)]) * (terrain.point / 100.0)
    place = (terrain.point, *terrain.origin, pose.x, pose.y, pose.heading, first)
    arcs = [(*arc, 0.0, 0.5) for arc in ARCS] + [(0.0, 0.0, turn, 0.5) for turn in (ON_THE_SPOT if turns else ())]
    sizes = (0.3, 0.2, radius, CLEARANCE, 1.0, 0.1, 2.0, CM_PER_M)
    grids = (terrain.blocked, terrain.room, nothing, lengths, 0, 0, limit)
    moves = [Drive(*arc) for arc in ARCS] + [Twist(0.0, turn) for turn in (ON_THE_SPOT if turns else ())]
    begins = np.array([path_is_free(terrain, pose, move, 1.0, radius) for move in moves], dtype=np.uint8)
    count = search(*grids, *place, np.array(arcs), begins, *sizes, 0.0, math.pi, MOST_NODES, found)
    return [moves[index] for index in found[:count]]


@settings(max_examples=80)
@given(**BODIES, x=st.floats(1.0, 7.0), y=st.floats(1.0, 7.0), turns=st.booleans())
@example(seed=2097153, point=0.1, radius=0.2, heading=0.0, x=1.0, y=1.0, turns=False)  # the body touches a wall
@example(seed=13675, point=0.25, radius=0.7578125, heading=0.0, x=1.0, y=1.0, turns=False)  # hardly any room
@example(seed=22247, point=0.1, radius=0.7, heading=-1.0, x=1.0, y=1.0, turns=True)  # others hear another point
def test_every_arc_found_is_free_and_leads_nearer(
    seed: int, point: float, radius: float, heading: float, x: float, y: float, turns: bool
) -> None:
    terrain = cluttered(seed, point)
    pose = Pose(x, y, heading)
    assume(fits(terrain, x, y, radius))
    rows, cols = np.mgrid[0 : terrain.height, 0 : terrain.width]
    left = np.hypot((rows + 0.5) * point - 7.0, (cols + 0.5) * point - 7.0)
    start = pose
    for drive in found_in(terrain, pose, left, radius, turns=turns):
        assert path_is_free(terrain, pose, drive, 1.0, radius)
        pose = advance(pose, drive, 1.0)
    if pose != start:
        assert left[heard_point(terrain, pose)] < left[heard_point(terrain, start)]


@settings(max_examples=200)
@given(
    **BODIES,
    arc=st.tuples(st.sampled_from([2.0, -2.0, 0.5, -0.5]), st.sampled_from([0.0, 1.0, -0.5])),
    place=st.tuples(st.floats(-0.5, 8.5), st.floats(-0.5, 8.5)),
    closes=st.booleans(),
)
def test_an_arc_is_free_where_the_body_fits_at_all_samples_and_none_is_closed(
    seed: int, point: float, radius: float, heading: float, arc: Spot, place: Spot, closes: bool
) -> None:
    terrain, samples, (x, y), (distance, curvature) = cluttered(seed, point), 40, place, arc
    closed = cluttered(seed + 1, point).blocked if closes else np.zeros((0, 0), dtype=np.uint8)
    free = True
    for sample in range(1, samples + 1):
        end = advance(Pose(x, y, heading), Drive(distance * sample / samples, curvature), 1.0)
        free = free and fits(terrain, end.x, end.y, radius) and not (closes and closed[terrain.point_at(end.x, end.y)])
    grids = (terrain.blocked, terrain.room, closed, point, *terrain.origin)
    shape, judged = np.zeros((samples, 4)), np.zeros(KEPT * KEPT, dtype=np.int64)
    _measure(distance, curvature, shape)
    memory = (judged, np.zeros((KEPT * KEPT, 4), dtype=np.int64))
    # What was judged before is kept, and does not change the result.
    for _ in range(2):
        assert bool(_is_free(*grids, x, y, heading, distance, shape, radius, *memory)) == free


def test_where_no_way_leads_nothing_is_found() -> None:
    terrain = plan((8.0, 8.0), (0.0, 0.0, 3.0, 8.0), (4.0, 0.0, 8.0, 8.0))
    # It stands as near to its goal behind the wall as it gets.
    rows, cols = np.mgrid[0:80, 0:80]
    left = np.hypot((rows + 0.5) * 0.1 - 4.0, (cols + 0.5) * 0.1 - 7.0)
    left[:, :25] += 10.0
    left[:, 24:25] = np.where(np.abs(rows[:, :1] - 40) < 2, 0.5, 20.0)
    assert found_in(terrain, Pose(2.45, 4.0, 0.0), left, 0.5) == []


def test_in_a_corridor_as_wide_as_its_body_only_a_body_that_turns_on_the_spot_faces_the_way_out() -> None:
    terrain = plan((8.0, 8.0), (3.5, 0.0, 4.5, 8.0))
    rows, _ = np.mgrid[0:80, 0:80]
    left = 8.0 - (rows + 0.5) * 0.1
    across = Pose(4.0, 2.0, 0.0)
    assert found_in(terrain, across, left, 0.45) == []
    commands = found_in(terrain, across, left, 0.45, turns=True)
    assert commands[0] == Twist(0.0, 1.5)
    end = across
    for command in commands:
        end = advance(end, command, 1.0)
    assert end.y >= 3.9


def test_a_plan_is_driven_to_its_end_and_made_anew_only_when_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    searched_at = set()

    def counted(*arguments: Any) -> int:
        searched_at.add(robots.k)
        return int(search(*arguments))

    monkeypatch.setattr("agent.bodies.manoeuvre.search", counted)
    robots = car(plan((40.0, 6.0), (0.0, 0.0, 40.0, 6.0)), Pose(2.0, 3.0, 0.0), (38.0, 3.0))
    for _ in range(60):
        robots.tick()
    assert 4 <= len(searched_at) <= 8
