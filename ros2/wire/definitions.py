"""The messages' definitions in ROS: their fields and type hashes.

Most come with rosbags. Those that do not are described here by their fields: bytes and hashes depend on nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from patrol.errors import BadInput

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

NO_HASH = "TypeHashNotSupported"
"""The text in place of a hash in ROS 2 Humble, which has none."""

ACTION = "nav2_msgs/action/NavigateToPose"
SEND_GOAL, GET_RESULT, FEEDBACK = (f"{ACTION}_{part}" for part in ("SendGoal", "GetResult", "FeedbackMessage"))
CANCEL_GOAL = "action_msgs/srv/CancelGoal"

_UUID, _GOAL_INFO = "unique_identifier_msgs/msg/UUID", "action_msgs/msg/GoalInfo"
_POSE, _DURATION = "geometry_msgs/msg/PoseStamped", "builtin_interfaces/msg/Duration"
_EVENT = "service_msgs/msg/ServiceEventInfo"

_MESSAGES = {
    "ackermann_msgs/msg/AckermannDrive": "float32 steering_angle, float32 steering_angle_velocity, float32 speed, "
    "float32 acceleration, float32 jerk",
    "ackermann_msgs/msg/AckermannDriveStamped": "std_msgs/msg/Header header, ackermann_msgs/msg/AckermannDrive drive",
    f"{ACTION}_Goal": f"{_POSE} pose, string behavior_tree",
    f"{ACTION}_Result": "uint16 error_code",
    f"{ACTION}_Feedback": f"{_POSE} current_pose, {_DURATION} navigation_time, {_DURATION} estimated_time_remaining, "
    "int16 number_of_recoveries, float32 distance_remaining",
    FEEDBACK: f"{_UUID} goal_id, {ACTION}_Feedback feedback",
}
"""Fields by type, of NavigateToPose as in ROS 2 Jazzy."""

_SERVICES = {
    SEND_GOAL: (f"{_UUID} goal_id, {ACTION}_Goal goal", "bool accepted, builtin_interfaces/msg/Time stamp"),
    GET_RESULT: (f"{_UUID} goal_id", f"int8 status, {ACTION}_Result result"),
    CANCEL_GOAL: (f"{_GOAL_INFO} goal_info", f"int8 return_code, {_GOAL_INFO}[] goals_canceling"),
}
"""Fields of request and response by service."""


@cache
def store() -> Typestore:
    """Return all types, from rosbags and from here; BadInput if the extra ``ros2`` is not installed."""
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise BadInput("ROS 2 robots need rosbags; install it with: pip install 'fogwatch[ros2]'") from None
    typestore = get_typestore(Stores.ROS2_JAZZY)
    # ROS takes a char of a message for a uint8, and so does the hash of every service, which includes this type.
    typestore.fielddefs[_EVENT] = (
        [],
        [
            (name, kind if name != "client_gid" else _describe_type("uint8[16]"))
            for name, kind in typestore.fielddefs[_EVENT][1]
        ],
    )
    typestore.register({name: ([], _describe_fields(fields)) for name, fields in _MESSAGES.items()})
    for service, (request, response) in _SERVICES.items():
        typestore.register(service_types(service, request, response))
    return typestore


def service_types(service: str, request: str, response: str) -> dict[str, Any]:
    """Return the types that a service consists of, as rosbags registers them, by the fields of request and response.

    The one of the service's own name has its hash.
    """
    request_type, answered, event = (f"{service}_{part}" for part in ("Request", "Response", "Event"))
    fields = {
        request_type: request,
        answered: response,
        event: f"{_EVENT} info, {request_type}[<=1] request, {answered}[<=1] response",
        service: f"{request_type} request_message, {answered} response_message, {event} event_message",
    }
    return {name: ([], _describe_fields(text)) for name, text in fields.items()}


@cache
def type_hash(name: str) -> str:
    """Return the hash of a type or a service, ``RIHS01_`` and 64 hex digits."""
    return store().hash_rihs01(name)


def make(type_name: str, values: Mapping[str, Any]) -> Any:
    """Return a message of ROS by the paths of its fields, such as ``header.frame_id``; all other fields are zero.

    For example, ``make("geometry_msgs/msg/Twist", {"linear.x": 1.0})`` drives ahead at 1 m/s without a turn.
    """
    from rosbags.interfaces import Nodetype

    fields: dict[str, Any] = {}
    node: int
    kind: Any
    for name, (node, kind) in store().fielddefs[type_name][1]:
        if name in values:
            fields[name] = values[name]
        elif node == Nodetype.NAME:
            inside = {path[len(name) + 1 :]: value for path, value in values.items() if path.startswith(f"{name}.")}
            fields[name] = make(kind, inside)
        elif node == Nodetype.ARRAY:
            (_, (dtype, _)), length = kind
            fields[name] = np.zeros(length, dtype)
        elif node == Nodetype.SEQUENCE:
            fields[name] = []
        else:
            fields[name] = "" if kind[0] == "string" else 0
    return store().types[type_name](**fields)


def _describe_fields(text: str) -> list[tuple[str, Any]]:
    return [(name, _describe_type(kind)) for kind, name in map(str.split, text.split(", "))]


def _describe_type(kind: str) -> Any:
    """Return a field's type as rosbags describes it: a type, an array ``T[3]``, a sequence ``T[]`` or ``T[<=3]``.

    For example, ``uint8[16]`` is an array of 16 bytes, and ``float64[]`` a sequence of any length.
    """
    from rosbags.interfaces import Nodetype

    element, bracket, count = kind.rstrip("]").partition("[")
    described: tuple[int, Any]
    described = (Nodetype.NAME, element) if "/" in element else (Nodetype.BASE, (element, 0))
    if not bracket:
        return described
    if count.isdigit():
        return (Nodetype.ARRAY, (described, int(count)))
    return (Nodetype.SEQUENCE, (described, int(count.removeprefix("<=") or 0)))
