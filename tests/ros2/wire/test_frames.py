import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.errors import BadInput
from patrol.ground.swept_path import advance
from patrol.pose import TAU, Pose, wrap
from patrol.pose import Twist as Command
from ros2.wire.frames import composed, inverted, pose_given, travelled
from ros2.wire.messages import Twist

lengths = st.floats(-50.0, 50.0)
angles = st.floats(-3.1, 3.1)
poses = st.builds(Pose, lengths, lengths, angles)


def same(one: Pose, other: Pose) -> None:
    assert (one.x, one.y) == pytest.approx((other.x, other.y), abs=1e-9)
    assert abs(wrap(one.heading - other.heading)) < 1e-9


@given(poses, poses, poses)
def test_frames_are_put_together_in_any_grouping_and_taken_apart_again(a: Pose, b: Pose, c: Pose) -> None:
    same(composed(composed(a, b), c), composed(a, composed(b, c)))
    same(composed(a, inverted(a)), Pose(0.0, 0.0, 0.0))
    same(composed(inverted(a), composed(a, b)), b)


def test_a_child_that_is_turned_left_sees_forward_as_up() -> None:
    same(composed(Pose(1.0, 2.0, math.pi / 2), Pose(3.0, 0.5, 0.25)), Pose(0.5, 5.0, math.pi / 2 + 0.25))


@given(poses, st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(0.0, 2.0))
def test_a_body_travels_as_the_world_moves_it(pose: Pose, speed: float, turn_rate: float, time_s: float) -> None:
    same(travelled(pose, Twist(speed, 0.0, turn_rate), time_s), advance(pose, Command(speed, turn_rate), time_s))


@given(poses, lengths, lengths, angles, st.floats(0.0, 1.0))
def test_the_way_back_ends_where_it_began(pose: Pose, vx: float, vy: float, turn_rate: float, time_s: float) -> None:
    twist = Twist(vx, vy, turn_rate)
    same(travelled(travelled(pose, twist, time_s), twist, -time_s), pose)


@pytest.mark.parametrize(("text", "heading"), [("1,2,-3", -3.0), ("1,2,6.2", 6.2 - TAU), ("1,2,-6.28", TAU - 6.28)])
def test_a_pose_is_read_from_an_option(text: str, heading: float) -> None:
    pose = pose_given("--start", text)
    assert (pose.x, pose.y, pose.heading) == pytest.approx((1.0, 2.0, heading))


@pytest.mark.parametrize("text", ["1,2,90", "1,2,-6.3"])
def test_a_heading_in_degrees_is_refused(text: str) -> None:
    with pytest.raises(BadInput, match=rf"^--start {text}: heading = .*: more than a full turn; give rad"):
        pose_given("--start", text)
