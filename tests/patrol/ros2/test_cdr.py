"""The same bytes as from a third encoder, which knows nothing of ROS: each structure is described here once more."""

from __future__ import annotations

from dataclasses import make_dataclass
from typing import Any

import numpy as np
import pytest

from patrol.pose import Pose
from patrol.ros2 import messages as ours
from patrol.ros2.codec import encode

pycdr2: Any = pytest.importorskip("pycdr2", reason="pycdr2 is not installed")
kinds: Any = pytest.importorskip("pycdr2.types", reason="pycdr2 is not installed")


def structure(name: str, **fields: Any) -> Any:
    return make_dataclass(name, list(fields.items()), bases=(pycdr2.IdlStruct,))


Time = structure("Time", sec=kinds.int32, nanosec=kinds.uint32)
Header = structure("Header", stamp=Time, frame_id=str)
Vector = structure("Vector", x=kinds.float64, y=kinds.float64, z=kinds.float64)
Turn = structure("Turn", x=kinds.float64, y=kinds.float64, z=kinds.float64, w=kinds.float64)
Place = structure("Place", position=Vector, orientation=Turn)
Speed = structure("Speed", linear=Vector, angular=Vector)
StampedSpeed = structure("StampedSpeed", header=Header, twist=Speed)
UncertainPlace = structure("UncertainPlace", pose=Place, covariance=kinds.array[kinds.float64, 36])
UncertainSpeed = structure("UncertainSpeed", twist=Speed, covariance=kinds.array[kinds.float64, 36])
Moving = structure("Moving", header=Header, child_frame_id=str, pose=UncertainPlace, twist=UncertainSpeed)
Facts = structure(
    "Facts", map_load_time=Time, resolution=kinds.float32, width=kinds.uint32, height=kinds.uint32, origin=Place
)
Grid = structure("Grid", header=Header, info=Facts, data=kinds.sequence[kinds.int8])

STAMP = 5_000_000_007
AT = Time(5, 7)
SPEED = Speed(Vector(1.0, -2.0, 0.0), Vector(0.0, 0.0, 0.5))
PLACE = Place(Vector(3.0, 4.0, 0.0), Turn(0.0, 0.0, 0.0, 1.0))
TWIST, POSE = ours.Twist(1.0, -2.0, 0.5), Pose(3.0, 4.0, 0.0)
NOTHING = [0.0] * 36


@pytest.mark.parametrize(
    ("message", "theirs"),
    [
        (TWIST, SPEED),
        (ours.TwistStamped(STAMP, "base", TWIST), StampedSpeed(Header(AT, "base"), SPEED)),
        (
            ours.Odometry(STAMP, "odom", "base_link", POSE, TWIST),
            Moving(Header(AT, "odom"), "base_link", UncertainPlace(PLACE, NOTHING), UncertainSpeed(SPEED, NOTHING)),
        ),
        (
            ours.OccupancyGrid(STAMP, "map", 0.25, POSE, np.array([[1, 2, 3]], dtype=np.int8)),
            Grid(Header(AT, "map"), Facts(AT, 0.25, 3, 1, PLACE), [1, 2, 3]),
        ),
    ],
    ids=lambda value: type(value).__name__,
)
def test_bytes_are_those_of_an_encoder_that_knows_nothing_of_ros(message: object, theirs: Any) -> None:
    assert encode(message) == theirs.serialize()
