import math
import struct
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap_ros2._dynamic import serialize_dynamic
from rosbags.typesys import Stores, get_typestore

from patrol.errors import BadInput, Malformed
from patrol.pose import Pose
from ros2.wire import messages as ours
from ros2.wire.codec import CODINGS, decode, encode
from ros2.wire.definitions import service_types, store, type_hash

STAMP = 1_700_000_000_123_456_789
STAMP_PARTS = {"sec": 1_700_000_000, "nanosec": 123_456_789}
IDENTITY = bytes(range(16))
SOMEWHERE = ours.PoseStamped(STAMP, "map", Pose(1.5, -2.5, 0.0))

MESSAGES: list[object] = [
    ours.Bool(True),
    ours.Clock(STAMP),
    ours.Twist(1.0, -2.0, 0.5),
    ours.TwistStamped(STAMP, "base_link", ours.Twist(1.0, -2.0, 0.5)),
    ours.TwistStamped(STAMP, "", ours.Twist(0.0, 0.0, 0.0)),
    ours.AckermannDriveStamped(STAMP, "base_link", 1.5, 0.25),
    SOMEWHERE,
    ours.PoseWithCovarianceStamped(STAMP, "map", Pose(1.5, -2.5, 0.0), (0.25, 0.5, 0.125)),
    ours.Odometry(STAMP, "odom", "base_link", Pose(1.5, -2.5, 0.0), ours.Twist(1.0, 0.0, 0.5), (0.25, 0.5, 0.125)),
    ours.TFMessage((ours.Transform(STAMP, "map", "odom", Pose(1.0, 2.0, 0.0)),)),
    ours.Path(STAMP, "map", (Pose(0.0, 0.0, 0.0), Pose(1.0, 0.5, 0.0))),
    ours.SendGoalRequest(IDENTITY, SOMEWHERE, "tree.xml"),
    ours.SendGoalResponse(True, STAMP),
    ours.GetResultRequest(IDENTITY),
    ours.GetResultResponse(4),
    ours.CancelRequest(IDENTITY, STAMP),
    ours.CancelResponse(0, (IDENTITY, bytes(16))),
    ours.GoalStatusArray(((IDENTITY, 2), (bytes(16), 6))),
]
GRID = ours.OccupancyGrid(STAMP, "map", 0.05, Pose(-1.0, 2.0, 0.0), np.array([[0, 100, -1], [50, 0, 7]], dtype=np.int8))


@pytest.mark.parametrize("message", MESSAGES, ids=lambda message: type(message).__name__)
def test_what_is_sent_is_what_is_received(message: object) -> None:
    assert decode(type(message), encode(message)) == message


def test_a_grid_is_received_as_it_was_sent() -> None:
    found = decode(ours.OccupancyGrid, encode(GRID))
    assert (found.stamp_ns, found.frame, found.resolution, found.origin) == (STAMP, "map", 0.05, Pose(-1.0, 2.0, 0.0))
    np.testing.assert_array_equal(found.cells, GRID.cells)
    assert found.cells.flags.writeable, "it does not keep the payload alive"


@given(st.floats(-math.pi, math.pi), st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_a_heading_survives_its_quaternion(heading: float, x: float, y: float) -> None:
    found = decode(ours.PoseStamped, encode(ours.PoseStamped(0, "map", Pose(x, y, heading)))).pose
    assert (found.x, found.y) == (x, y)
    assert math.isclose(math.remainder(found.heading - heading, math.tau), 0.0, abs_tol=1e-12)


# --- the same bytes as an encoder that is not ours --------------------------------------------------------------------


def independent(kind: str, fields: dict[str, Any]) -> bytes:
    definition, _ = store().generate_msgdef(kind, ros_version=2)
    return bytes(serialize_dynamic(kind, definition)[kind](fields))


def vector(x: float, y: float, z: float) -> dict[str, float]:
    return {"x": x, "y": y, "z": z}


def header(frame: str) -> dict[str, Any]:
    return {"stamp": dict(STAMP_PARTS), "frame_id": frame}


TURN = math.pi / 3
SPEED, VARIANCES = ours.Twist(1.0, -2.0, 0.5), (0.25, 0.5, 0.125)
TWIST = {"linear": vector(1.0, -2.0, 0.0), "angular": vector(0.0, 0.0, 0.5)}
ORIENTATION = {"x": 0.0, "y": 0.0, "z": math.sin(TURN / 2), "w": math.cos(TURN / 2)}
UPRIGHT = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
PLACED = {"position": vector(1.5, -2.5, 0.0), "orientation": ORIENTATION}
COVARIANCE = [{0: 0.25, 7: 0.5, 35: 0.125}.get(place, 0.0) for place in range(36)]
INFO = {"map_load_time": STAMP_PARTS, "resolution": 0.05, "width": 3, "height": 2, "origin": PLACED}
STEERED = {"steering_angle": 0.25, "steering_angle_velocity": 0.0, "speed": 1.5, "acceleration": 0.5, "jerk": 0.0}
STATUS = {"level": 2, "name": "né: radio", "message": "hears 0 of 1", "hardware_id": "r1"}
WELL = {"level": 0, "name": "", "message": "", "hardware_id": "", "values": []}
MOVED = {"translation": vector(1.0, 2.0, 0.0), "rotation": ORIENTATION}

SAME: list[tuple[object, dict[str, Any], int]] = [
    (SPEED, TWIST, 52),
    (ours.TwistStamped(STAMP, "base_link", SPEED), {"header": header("base_link"), "twist": TWIST}, 76),
    (
        ours.Odometry(STAMP, "odom", "base_link", Pose(1.5, -2.5, TURN), SPEED, VARIANCES),
        {
            "header": header("odom"),
            "child_frame_id": "base_link",
            "pose": {"pose": PLACED, "covariance": COVARIANCE},
            "twist": {"twist": TWIST, "covariance": [0.0] * 36},
        },
        724,
    ),
    (
        ours.OccupancyGrid(STAMP, "map", 0.05, Pose(1.5, -2.5, TURN), GRID.cells),
        {"header": header("map"), "info": INFO, "data": [0, 100, -1, 50, 0, 7]},
        110,
    ),
    (
        ours.AckermannDriveStamped(STAMP, "base_link", 1.5, 0.25, 0.5),
        {"header": header("base_link"), "drive": STEERED},
        48,
    ),
    (
        ours.DiagnosticArray(
            STAMP,
            (
                ours.DiagnosticStatus(ours.DiagnosticLevel.ERROR, "né: radio", "hears 0 of 1", "r1", (("a", "b"),)),
                ours.DiagnosticStatus(ours.DiagnosticLevel.OK, "", "", ""),
            ),
        ),
        {"header": header(""), "status": [{**STATUS, "values": [{"key": "a", "value": "b"}]}, WELL]},
        120,
    ),
    (
        ours.TFMessage((ours.Transform(STAMP, "map", "odom", Pose(1.0, 2.0, TURN)),)),
        {"transforms": [{"header": header("map"), "child_frame_id": "odom", "transform": MOVED}]},
        92,
    ),
]


@pytest.mark.parametrize(("message", "fields", "size"), SAME, ids=lambda value: type(value).__name__)
def test_bytes_are_those_of_an_independent_encoder(message: object, fields: dict[str, Any], size: int) -> None:
    payload = encode(message)
    assert payload == independent(CODINGS[type(message)].type_name, fields)
    assert len(payload) == size


def fill(message: Any, fields: dict[str, Any]) -> Any:
    """Set fields of a message of `ros2_pyterfaces`, and of the messages in it."""
    for name, value in fields.items():
        if isinstance(value, dict):
            fill(getattr(message, name), value)
        else:
            setattr(message, name, value)
    return message


@pytest.mark.parametrize(("message", "fields", "_size"), SAME[:4], ids=lambda value: type(value).__name__)
def test_bytes_are_those_of_an_encoder_with_own_definitions(
    message: object, fields: dict[str, Any], _size: int
) -> None:
    theirs = pytest.importorskip("ros2_pyterfaces.cyclone.all_msgs", reason="ros2-pyterfaces is not installed")
    kind = getattr(theirs, CODINGS[type(message)].type_name.rpartition("/")[2])
    assert encode(message) == bytes(fill(kind(), fields).serialize())


def test_hashes_are_those_of_other_definitions() -> None:
    theirs = pytest.importorskip("ros2_pyterfaces.cyclone.all_msgs", reason="ros2-pyterfaces is not installed")
    named = [coding.type_name.split("/") for coding in CODINGS.values()]
    ours_too = [f"{package}/msg/{name}" for package, kind, name in named if kind == "msg" and package not in NOT_THEIRS]
    assert len(ours_too) >= 10
    for type_name in ours_too:
        assert getattr(theirs, type_name.rpartition("/")[2]).hash_rihs01() == type_hash(type_name)


def test_hashes_are_those_that_others_publish() -> None:
    """String and AddTwoInts in the design text of rmw_zenoh, the others by what ROS prints of them."""
    store().register(service_types("example_interfaces/srv/AddTwoInts", "int64 a, int64 b", "int64 sum"))
    assert {name: type_hash(name).removeprefix("RIHS01_") for name in PUBLISHED} == PUBLISHED


NOT_THEIRS = {"action_msgs", "ackermann_msgs", "tf2_msgs"}
"""Packages that ros2-pyterfaces does not have."""

PUBLISHED = {
    "diagnostic_msgs/msg/DiagnosticArray": "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    "std_msgs/msg/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "geometry_msgs/msg/Twist": "9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
    "example_interfaces/srv/AddTwoInts": "e118de6bf5eeb66a2491b5bda11202e7b68f198d6f67922cf30364858239c81a",
    "action_msgs/srv/CancelGoal": "573d8b0a534451d7bc2ac8c5ffde8ac14b8593b7001175d0cd6516dcbeb8689a",
    "action_msgs/msg/GoalStatusArray": "6c1684b00f177d37438febe6e709fc4e2b0d4248dca4854946f9ed8b30cda83e",
}


# --- what others send -------------------------------------------------------------------------------------------------


def pose_with(**changes: Any) -> bytes:
    fields = {"header": header("map"), "pose": {"position": vector(1.0, 2.0, 0.0), "orientation": dict(UPRIGHT)}}
    for place, value in changes.items():
        at: Any = fields
        *way, last = place.split("__")
        for step in way:
            at = at[step]
        at[last] = value
    return independent("geometry_msgs/msg/PoseStamped", fields)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"pose__position__x": math.nan}, "not a number of metres"),
        ({"pose__position__y": -math.inf}, "not a number of metres"),
        ({"pose__position__z": math.nan}, "not a number of metres"),
        ({"pose__position__x": 1e12}, "not a number of metres"),
        ({"pose__orientation__w": 0.0}, "a rotation's quaternion is of length 0 and not 1"),
        ({"pose__orientation__w": math.nan}, "is of length nan"),
        ({"pose__orientation__w": 7.0}, "is of length 7"),
        ({"header__frame_id": ""}, "a frame's name"),
        ({"header__frame_id": "m\x1b[2Jap"}, "a frame's name"),
        ({"header__frame_id": "m" * 256}, "a frame's name"),
        ({"header__stamp__sec": -1}, "a time before the epoch"),
        ({"header__stamp__nanosec": 1_000_000_000}, "more than a second of nanoseconds"),
    ],
)
def test_what_is_of_no_use_is_refused(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(Malformed, match=says):
        decode(ours.PoseStamped, pose_with(**changes))


def test_a_quaternion_that_is_nearly_of_length_one_is_normalised() -> None:
    half = 0.95 * math.sqrt(0.5)
    found = decode(ours.PoseStamped, pose_with(pose__orientation__z=half, pose__orientation__w=half))
    assert math.isclose(found.pose.heading, math.pi / 2)


def test_a_bad_transform_costs_no_other() -> None:
    good = {"header": header("map"), "child_frame_id": "odom", "transform": {**MOVED, "rotation": UPRIGHT}}
    bad = {**good, "child_frame_id": "camera", "transform": {**MOVED, "rotation": {**UPRIGHT, "w": 0.0}}}
    found = decode(ours.TFMessage, independent("tf2_msgs/msg/TFMessage", {"transforms": [bad, good]}))
    assert found == ours.TFMessage((ours.Transform(STAMP, "map", "odom", Pose(1.0, 2.0, 0.0)),))


def test_variances_that_are_nonsense_are_unknown() -> None:
    message = ours.PoseWithCovarianceStamped(STAMP, "map", Pose(0.0, 0.0, 0.0), (1.0, 2.0, 3.0))
    payload = bytearray(encode(message))
    for value, nonsense in ((1.0, math.nan), (3.0, -1.0)):
        at = payload.rindex(struct.pack("<d", value))
        payload[at : at + 8] = struct.pack("<d", nonsense)
    assert decode(ours.PoseWithCovarianceStamped, bytes(payload)).variances == (0.0, 2.0, 0.0)


def test_both_byte_orders_are_read() -> None:
    found = decode(ours.Bool, b"\x00\x00\x00\x00\x01")
    assert found == ours.Bool(True)
    big = b"\x00\x00\x00\x00" + struct.pack(">6d", 1.0, 0.0, 0.0, 0.0, 0.0, 0.5)
    assert decode(ours.Twist, big) == ours.Twist(1.0, 0.0, 0.5)


def test_how_a_goal_ended_is_read_from_every_release() -> None:
    for rest in (b"\x00", b"\x00\x00\x05", b"\x00\x00\x05\x00\x00\x04\x00\x00\x00abc\x00"):
        assert decode(ours.GetResultResponse, b"\x00\x01\x00\x00\x06" + rest) == ours.GetResultResponse(6)


@pytest.mark.parametrize("kind", [kind for kind in CODINGS if CODINGS[kind].longest])
@given(st.data())
def test_no_bytes_do_anything_but_be_refused(kind: type, data: st.DataObject) -> None:
    """Of the right message, with bytes changed, cut off or added; and any bytes at all."""
    whole = encode(next(one for one in [*MESSAGES, GRID] if type(one) is kind))
    other = st.binary(max_size=200).map(lambda tail: whole[:4] + tail)
    payload = bytearray(data.draw(st.one_of(st.just(whole), other)))
    for _ in range(data.draw(st.integers(0, 8))):
        if payload:
            payload[data.draw(st.integers(0, len(payload) - 1))] = data.draw(st.sampled_from([0, 1, 0x7F, 0x80, 0xFF]))
    cut = data.draw(st.integers(0, len(payload)))
    for given_bytes in (bytes(payload), bytes(payload[:cut]), bytes(payload) + b"\xff" * cut):
        with suppress(Malformed):
            decode(kind, given_bytes)


@pytest.mark.parametrize("kind", CODINGS)
def test_nothing_longer_than_its_kind_is_read(kind: type) -> None:
    with pytest.raises(Malformed, match=r"at most|only sent"):
        decode(kind, bytes(CODINGS[kind].longest + 1))


def test_lengths_that_lie_allocate_nothing() -> None:
    payload = bytearray(encode(ours.TFMessage(())))
    payload[4:8] = b"\xff\xff\xff\xff"
    for kind in (ours.TFMessage, ours.GoalStatusArray, ours.CancelResponse):
        with pytest.raises(Malformed):
            decode(kind, bytes(payload))
    lying = bytearray(encode(GRID))
    lying[-6 - 4 : -6] = struct.pack("<I", 2**31)
    with pytest.raises(Malformed):
        decode(ours.OccupancyGrid, bytes(lying))


def test_what_must_not_be_sent_is_not_encoded() -> None:
    nan = math.nan
    for message in (
        ours.Twist(nan, 0.0, 0.0),
        ours.TwistStamped(STAMP, "b", ours.Twist(0.0, 0.0, math.inf)),
        ours.AckermannDriveStamped(STAMP, "b", 1.0, nan),
        ours.TwistStamped(-1, "b", ours.Twist(0.0, 0.0, 0.0)),
        ours.TwistStamped(STAMP, "\n", ours.Twist(0.0, 0.0, 0.0)),
        ours.PoseStamped(STAMP, "map", Pose(0.0, 0.0, nan)),
        ours.CancelRequest(b"short"),
        ours.OccupancyGrid(STAMP, "map", 0.05, Pose(0.0, 0.0, 0.0), np.zeros((0, 3), np.int8)),
        ours.OccupancyGrid(STAMP, "map", nan, Pose(0.0, 0.0, 0.0), np.zeros((1, 3), np.int8)),
    ):
        with pytest.raises(Malformed):
            encode(message)


def test_without_the_extra_it_is_said_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    with pytest.raises(BadInput, match=r"pip install 'fogwatch\[ros2\]'") as caught:
        store.__wrapped__()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("release", [Stores.ROS2_HUMBLE, Stores.ROS2_IRON, Stores.ROS2_JAZZY, Stores.ROS2_KILTED])
def test_our_types_are_those_of_each_release_and_of_the_documents_table(release: Stores) -> None:
    table = (Path(__file__).parents[3] / "docs/ros2/releases.md").read_text(encoding="utf-8")
    theirs = get_typestore(release)
    listed = [coding for coding in CODINGS.values() if "/msg/" in coding.type_name]
    assert len(listed) > 10
    for coding in listed:
        assert f"| `{coding.type_name}` | `{coding.type_hash}` |" in table
        if coding.type_name in theirs.types:
            assert theirs.hash_rihs01(coding.type_name) == coding.type_hash
