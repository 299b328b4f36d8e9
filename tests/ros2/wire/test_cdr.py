"""The same bytes and hashes as from ros2-pyterfaces, which has definitions and an encoder of its own."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from patrol.pose import Pose
from ros2.wire import messages as ours
from ros2.wire.codec import CODINGS, encode
from ros2.wire.definitions import type_hash

theirs: Any = pytest.importorskip("ros2_pyterfaces.cyclone.all_msgs", reason="ros2-pyterfaces is not installed")

STAMP = 5_000_000_007
HEADER = {"stamp": {"sec": 5, "nanosec": 7}}
TWIST, POSE = ours.Twist(1.0, -2.0, 0.5), Pose(3.0, 4.0, 0.0)
SPEED = {"linear": {"x": 1.0, "y": -2.0}, "angular": {"z": 0.5}}
PLACE = {"position": {"x": 3.0, "y": 4.0}, "orientation": {"w": 1.0}}

NOT_THEIRS = {"action_msgs", "ackermann_msgs", "tf2_msgs"}
"""Packages that it does not have."""
TYPES = sorted(coding.type_name for coding in CODINGS.values() if "/msg/" in coding.type_name)


def fill(message: Any, fields: dict[str, Any]) -> Any:
    """Set fields of a message, and of the messages in it."""
    for name, value in fields.items():
        if isinstance(value, dict):
            fill(getattr(message, name), value)
        else:
            setattr(message, name, value)
    return message


@pytest.mark.parametrize(
    ("message", "fields"),
    [
        (TWIST, SPEED),
        (ours.TwistStamped(STAMP, "base", TWIST), {"header": {**HEADER, "frame_id": "base"}, "twist": SPEED}),
        (
            ours.Odometry(STAMP, "odom", "base_link", POSE, TWIST),
            {
                "header": {**HEADER, "frame_id": "odom"},
                "child_frame_id": "base_link",
                "pose": {"pose": PLACE},
                "twist": {"twist": SPEED},
            },
        ),
        (
            ours.OccupancyGrid(STAMP, "map", 0.25, POSE, np.array([[1, 2, 3]], dtype=np.int8)),
            {
                "header": {**HEADER, "frame_id": "map"},
                "info": {
                    "map_load_time": HEADER["stamp"],
                    "resolution": 0.25,
                    "width": 3,
                    "height": 1,
                    "origin": PLACE,
                },
                "data": [1, 2, 3],
            },
        ),
    ],
    ids=lambda value: type(value).__name__,
)
def test_bytes_are_those_of_another_encoder(message: object, fields: dict[str, Any]) -> None:
    name = CODINGS[type(message)].type_name.rpartition("/")[2]
    assert encode(message) == bytes(fill(getattr(theirs, name)(), fields).serialize())


@pytest.mark.parametrize("type_name", [name for name in TYPES if name.partition("/")[0] not in NOT_THEIRS])
def test_hashes_are_those_of_other_definitions(type_name: str) -> None:
    assert getattr(theirs, type_name.rpartition("/")[2]).hash_rihs01() == type_hash(type_name)
