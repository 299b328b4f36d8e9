"""Each message of a recording, decoded again, and the values of its grids."""

import math
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from monitor.recording.ros_file import RESERVED_NAMES, grid_values, ros_names, wall_values
from monitor.recording.ros_messages import FRAME, GRID, LOG, NUMBER, POSE, TRANSFORMS, Encoder
from patrol.ground.fog import Fog

AT_NS = 3_000_000_007


def decoded(payload: bytes, kind: str) -> Any:
    return get_typestore(Stores.ROS2_JAZZY).deserialize_cdr(payload, kind)


def stamp_of(stamp: Any) -> tuple[int, int]:
    return stamp.sec, stamp.nanosec


def turn_of(turn: Any) -> float:
    assert (turn.x, turn.y) == (0.0, 0.0)
    assert math.hypot(turn.z, turn.w) == pytest.approx(1.0)
    return 2.0 * math.atan2(turn.z, turn.w)


def test_a_number_and_a_line_of_the_log_come_back() -> None:
    assert decoded(Encoder().number(-2.5), NUMBER).data == -2.5
    line = decoded(Encoder().log(AT_NS, 30, "r1", "dead"), LOG)
    assert (stamp_of(line.stamp), line.level, line.name, line.msg) == ((3, 7), 30, "r1", "dead")


@pytest.mark.parametrize("heading", [0.0, 0.5, -1.2, 3.0])
def test_poses_and_transforms_come_back(heading: float) -> None:
    told = decoded(Encoder().pose(AT_NS, 1.5, -2.0, heading), POSE)
    assert (stamp_of(told.header.stamp), told.header.frame_id) == ((3, 7), FRAME)
    place = told.pose.position
    assert (place.x, place.y, place.z) == (1.5, -2.0, 0.0)
    assert turn_of(told.pose.orientation) == pytest.approx(heading)
    bodies = [("one", 1.5, -2.0, heading), ("two", 3.0, 4.0, -heading)]
    moved = decoded(Encoder().transforms(AT_NS, bodies), TRANSFORMS).transforms
    for each, (name, x, y, turn) in zip(moved, bodies, strict=True):
        assert (stamp_of(each.header.stamp), each.header.frame_id, each.child_frame_id) == ((3, 7), FRAME, name)
        shift = each.transform.translation
        assert (shift.x, shift.y, shift.z) == (x, y, 0.0)
        assert turn_of(each.transform.rotation) == pytest.approx(turn)


def test_a_grid_comes_back_row_by_row_from_its_lower_left_corner() -> None:
    values = np.array([[0, 1, 2], [100, -1, 50]], dtype=np.int8)
    for given in (values, np.asfortranarray(values)):
        told = decoded(Encoder().grid(AT_NS, 0.25, (-3.0, 7.0), given), GRID)
        assert (stamp_of(told.header.stamp), told.header.frame_id) == ((3, 7), FRAME)
        info = told.info
        assert (info.resolution, info.width, info.height, stamp_of(info.map_load_time)) == (0.25, 3, 2, (0, 0))
        corner = info.origin.position
        assert (corner.x, corner.y, corner.z, turn_of(info.origin.orientation)) == (-3.0, 7.0, 0.0, 0.0)
        assert told.data.tolist() == [0, 1, 2, 100, -1, 50]


def test_walls_are_occupied_and_the_rest_is_free() -> None:
    values = wall_values(np.array([[True, False, True], [False, False, True]]))
    assert values.dtype == np.int8
    assert values.tolist() == [[0, 100, 0], [100, 100, 0]]


@pytest.mark.parametrize(
    ("scale", "values"), [(8.0, [[100, 100, 50], [12, 0, -1]]), (16.0, [[62, 50, 25], [6, 0, -1]])]
)
def test_ages_go_from_0_to_100_of_the_scale(scale: float, values: list[list[int]]) -> None:
    fog = Fog(np.array([[True, True, True], [True, True, False]]))
    fog.last_seen[:] = [[-1, 2, 6], [9, 10, 10]]
    assert grid_values(fog, 10, scale).tolist() == values


def test_names_of_topics_differ_from_each_other_and_from_those_that_are_taken() -> None:
    taken = sorted(RESERVED_NAMES)
    assert ros_names(taken) == [f"robot_{name}" for name in taken]
    assert ros_names(["a b", "a-b", "a.b", "ä", "1"]) == ["a_b", "a_b_2", "a_b_3", "_", "robot_1"]
