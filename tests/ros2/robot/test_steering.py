"""Steering by velocities: when a robot counts as blocked."""

import pytest

from patrol.pose import Pose
from tests.ros2.robot.test_driver import AHEAD, STILL, Bench

FREE, BEFORE_THE_WALL = Pose(2.0, 5.0, 0.0), Pose(9.75, 5.0, 0.0)


def steps(bench: Bench, pose: Pose, count: int) -> None:
    for _ in range(count):
        bench.at(pose)
        bench.steering.want(AHEAD, None, 0.0)
        bench.steering.step(bench.fix(), 0.0, 0.05, "")


@pytest.mark.parametrize(("held", "free", "blocked"), [(4, 0, True), (3, 2, True), (2, 2, False)])
def test_it_is_blocked_if_the_fence_has_held_it_in_most_steps_since_the_last_look(
    held: int, free: int, blocked: bool
) -> None:
    bench = Bench()
    steps(bench, FREE, 1)
    assert not bench.steering.blocked(FREE)
    for _ in range(3):
        steps(bench, BEFORE_THE_WALL, held)
        assert bench.told == STILL
        steps(bench, FREE, free)
        assert bench.steering.blocked(FREE) is blocked
        steps(bench, FREE, 2)
        assert not bench.steering.blocked(FREE)
