import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from patrol.ground.swept_path import advance, chords, free_fraction, lay_path, path_is_free
from patrol.ground.terrain import Terrain
from patrol.pose import Command, Drive, Limits, Pose, Twist, Velocity

# Not the product's own, so that a wrong one there is noticed.
SAGITTA = 1e-4


@pytest.fixture
def room() -> Terrain:
    """10 x 10 m of half-metre points; a wall over x in [6, 6.5) below y = 8, keep-out below y = 1."""
    passable = np.ones((20, 20), dtype=np.bool_)
    passable[:16, 12] = False
    keep_out = np.zeros_like(passable)
    keep_out[:2] = True
    return Terrain("room", passable, 0.5, (0.0, 0.0), keep_out)


def test_a_holonomic_robot_faces_the_way_it_moves_and_a_car_follows_its_arc() -> None:
    assert advance(Pose(1.0, 1.0, 0.3), Velocity(0.0, -2.0), 0.5) == Pose(1.0, 0.0, -math.pi / 2)
    assert advance(Pose(1.0, 1.0, 0.3), Velocity(0.0, 0.0), 0.5) == Pose(1.0, 1.0, 0.3)
    assert advance(Pose(1.0, 1.0, 0.3), Velocity(0.0, 0.0, 1.0), 0.5) == Pose(1.0, 1.0, 1.0)
    assert advance(Pose(1.0, 1.0, 0.3), Velocity(0.0, -2.0, -math.pi), 0.5) == Pose(1.0, 0.0, math.pi)
    quarter = advance(Pose(0.0, 0.0, 0.0), Drive(math.pi, 0.5), 1.0)
    assert (quarter.x, quarter.y, quarter.heading) == pytest.approx((2.0, 2.0, math.pi / 2))
    back = advance(quarter, Drive(-math.pi, 0.5), 1.0)
    assert (back.x, back.y, back.heading) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    assert advance(quarter, Drive(0.0, 0.5), 1.0) == quarter


@pytest.mark.parametrize(
    ("command", "step", "free"),
    [
        *((Velocity(1.0, 0.0), 0.5, True), (Velocity(1.1, 0.0), 0.5, False)),
        *((Velocity(0.0, -4.0), 1.0, False), (Velocity(0.0, 4.0), 1.0, True)),
        *((Drive(1.0, 0.0), 0.5, True), (Drive(8.0, 0.0), 0.5, False)),
        *((Twist(1.0, 0.0), 0.5, True), (Twist(1.1, 0.0), 0.5, False)),
        *((Twist(8.0, 0.2), 0.5, False), (Twist(-8.0, 0.0), 0.5, True)),
        # A circle of 0.5 m radius to the left touches the wall, one of 1 m does not pass.
        *((Twist(2.0, 4.0), 2.0, True), (Twist(4.0, 4.0), 2.0, False)),
    ],
)
def test_walls_and_keep_out_stop_bodies(room: Terrain, command: Command, step: float, free: bool) -> None:
    assert path_is_free(room, Pose(5.0, 5.0, 0.0), command, step, 0.5) == free


def test_a_line_is_cut_where_it_touches(room: Terrain) -> None:
    assert free_fraction(room, Pose(5.0, 5.0, 0.0), Pose(7.0, 5.0, 0.0), 0.5) == pytest.approx(0.25)
    assert free_fraction(room, Pose(5.0, 9.0, 0.0), Pose(8.0, 9.0, 0.0), 0.5) == 1.0


@pytest.mark.parametrize("curvature", [1e-5, 1e-7, 1e-12, -1e-16, 5e-324])
@pytest.mark.parametrize("speed", [2.2, -2.2])
def test_an_arc_that_is_almost_a_line_is_stopped_by_what_stops_the_line(curvature: float, speed: float) -> None:
    passable = np.ones((100, 100), dtype=np.bool_)
    passable[40:60, 48:52] = False
    terrain = Terrain("block", passable, 0.5)
    here = Pose(25.0 - math.copysign(3.0, speed), 25.0, 0.0)
    assert not path_is_free(terrain, here, Drive(speed, 0.0), 1.0, 1.0)
    assert not path_is_free(terrain, here, Drive(speed, curvature), 1.0, 1.0)
    assert path_is_free(terrain, here, Drive(-speed, curvature), 1.0, 1.0)


HERE = Pose(5.0, 5.0, 0.3)
twists = st.builds(Twist, st.floats(-5.0, 5.0), st.floats(-20.0, 20.0))


def integrated(pose: Pose, twist: Twist, step: float, pieces: int = 20_000) -> Pose:
    """The pose after one step by the midpoint rule, which leaves an error of (turn rate * piece)^2."""
    piece = step / pieces
    headings = pose.heading + twist.turn_rate * piece * (np.arange(pieces) + 0.5)
    x, y = (sum(map(turned, headings)) * twist.speed * piece for turned in (math.cos, math.sin))
    return Pose(pose.x + x, pose.y + y, math.remainder(pose.heading + twist.turn_rate * step, math.tau))


@given(twist=twists, step=st.sampled_from([0.1, 0.5, 1.0]))
@example(twist=Twist(2.0, 1e-9), step=0.5)
@example(twist=Twist(2.0, 5e-324), step=0.5)
@example(twist=Twist(5e-324, 20.0), step=0.5)
@example(twist=Twist(1e-12, -20.0), step=1.0)
@example(twist=Twist(2.0, 4.0 * math.pi), step=0.5)
def test_two_wheels_drive_the_arc_that_integration_gives(twist: Twist, step: float) -> None:
    end, due = advance(HERE, twist, step), integrated(HERE, twist, step)
    assert (end.x, end.y) == pytest.approx((due.x, due.y), abs=1e-6)
    assert math.cos(end.heading - due.heading) == pytest.approx(1.0, abs=1e-12)
    assert -math.pi < end.heading <= math.pi


@given(turn_rate=st.floats(-1e3, 1e3), heading=st.floats(-3.0, 3.0))
def test_a_turn_on_the_spot_changes_the_heading_alone(turn_rate: float, heading: float) -> None:
    here = Pose(5.0, 5.0, heading)
    there = advance(here, Twist(0.0, turn_rate), 0.5)
    assert (there.x, there.y) == (here.x, here.y)
    assert math.cos(there.heading - heading - 0.5 * turn_rate) == pytest.approx(1.0, abs=1e-9)


def test_a_turn_on_the_spot_is_free_wherever_the_body_is(room: Terrain) -> None:
    for x in (5.5, 5.6, 7.0, 0.2):  # touching the wall, in it, in the open, over the edge
        assert path_is_free(room, Pose(x, 5.0, 0.0), Twist(0.0, 3.0), 0.5, 0.5)


@given(twist=twists, step=st.sampled_from([0.1, 0.5, 1.0]))
def test_the_chords_of_an_arc_lie_on_it(twist: Twist, step: float) -> None:
    count = chords(twist, step)
    assert count <= 3000
    path = np.empty((count + 1, 2), dtype=np.float64)
    lay_path(path, HERE, twist, step)
    assert tuple(path[0]) == (HERE.x, HERE.y)
    end = advance(HERE, twist, step)
    assert tuple(path[-1]) == pytest.approx((end.x, end.y))
    for i in {0, count // 2, count - 1}:
        (x0, y0), (x1, y1) = path[i], path[i + 1]
        for share in (0.25, 0.5, 0.75):
            on_arc = advance(HERE, twist, step * (i + share) / count)
            along, up = x1 - x0, y1 - y0
            length = math.hypot(along, up)
            off = (
                math.dist((on_arc.x, on_arc.y), (x0, y0))
                if length < 1e-9
                else abs(along * (on_arc.y - y0) - up * (on_arc.x - x0)) / length
            )
            assert off <= SAGITTA + 1e-9


@given(x=st.floats(0.6, 5.4), y=st.floats(1.6, 9.0), heading=st.floats(-math.pi, math.pi), twist=twists)
def test_a_path_of_two_wheels_that_is_free_touches_no_wall(x: float, y: float, heading: float, twist: Twist) -> None:
    passable = np.ones((20, 20), dtype=np.bool_)
    passable[:16, 12] = False
    terrain = Terrain("room", passable, 0.5, (0.0, 0.0))
    here, limited = Pose(x, y, heading), twist.limited(Limits(3.0, 0.5, 1.0))
    if not path_is_free(terrain, here, limited, 1.0, 0.5):
        return
    for share in np.linspace(0.0, 1.0, 60):
        at = advance(here, limited, float(share))
        assert at.x >= 0.5 - 3e-4
        assert 0.5 - 3e-4 <= at.y <= 9.5 + 3e-4
        wall = math.hypot(max(6.0 - at.x, 0.0, at.x - 6.5), max(at.y - 8.0, 0.0))
        assert wall >= 0.5 - 3e-4
