"""The messages' definitions in ROS: their fields and type hashes.

Most come with rosbags. Those that do not are described here by their fields: bytes and hashes depend on nothing else.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from patrol.errors import BadInput

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

NO_HASH = "TypeHashNotSupported"
"""The text in place of a hash in ROS 2 Humble, which has none."""

ACTION = "nav2_msgs/action/NavigateToPose"
SEND_GOAL, GET_RESULT, FEEDBACK = (f"{ACTION}_{part}" for part in ("SendGoal", "GetResult", "FeedbackMessage"))
CANCEL_GOAL = "action_msgs/srv/CancelGoal"

_UUID, _TIME = "unique_identifier_msgs/msg/UUID", "builtin_interfaces/msg/Time"
_POSE, _DURATION = "geometry_msgs/msg/PoseStamped", "builtin_interfaces/msg/Duration"
_EVENT = "service_msgs/msg/ServiceEventInfo"

_MESSAGES: dict[str, tuple[tuple[str, str], ...]] = {
    "ackermann_msgs/msg/AckermannDrive": (
        ("steering_angle", "float32"),
        ("steering_angle_velocity", "float32"),
        ("speed", "float32"),
        ("acceleration", "float32"),
        ("jerk", "float32"),
    ),
    "ackermann_msgs/msg/AckermannDriveStamped": (
        ("header", "std_msgs/msg/Header"),
        ("drive", "ackermann_msgs/msg/AckermannDrive"),
    ),
    f"{ACTION}_Goal": (("pose", _POSE), ("behavior_tree", "string")),
    f"{ACTION}_Result": (("error_code", "uint16"),),
    f"{ACTION}_Feedback": (
        ("current_pose", _POSE),
        ("navigation_time", _DURATION),
        ("estimated_time_remaining", _DURATION),
        ("number_of_recoveries", "int16"),
        ("distance_remaining", "float32"),
    ),
    FEEDBACK: (("goal_id", _UUID), ("feedback", f"{ACTION}_Feedback")),
}
"""Fields by type, of NavigateToPose as in ROS 2 Jazzy."""

_SERVICES: dict[str, tuple[tuple[tuple[str, str], ...], tuple[tuple[str, str], ...]]] = {
    SEND_GOAL: (
        (("goal_id", _UUID), ("goal", f"{ACTION}_Goal")),
        (("accepted", "bool"), ("stamp", _TIME)),
    ),
    GET_RESULT: (
        (("goal_id", _UUID),),
        (("status", "int8"), ("result", f"{ACTION}_Result")),
    ),
    CANCEL_GOAL: (
        (("goal_info", "action_msgs/msg/GoalInfo"),),
        (("return_code", "int8"), ("goals_canceling", "action_msgs/msg/GoalInfo[]")),
    ),
}
"""Fields of request and response by service."""


@cache
def store() -> Typestore:
    """Return all types, from rosbags and from here; BadInput if the extra ``ros2`` is not installed."""
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise BadInput("ROS 2 robots need rosbags; install it with: pip install 'fogwatch[ros2]'") from None
    made = get_typestore(Stores.ROS2_JAZZY)
    # ROS takes a char of a message for a uint8, and so does the hash of every service, which includes this type.
    made.fielddefs[_EVENT] = (
        [],
        [(name, kind if name != "client_gid" else _described("uint8[16]")) for name, kind in made.fielddefs[_EVENT][1]],
    )
    made.register({name: ([], _fields(fields)) for name, fields in _MESSAGES.items()})
    for service, (request, response) in _SERVICES.items():
        made.register(service_types(service, request, response))
    return made


def service_types(
    service: str, request: tuple[tuple[str, str], ...], response: tuple[tuple[str, str], ...]
) -> dict[str, Any]:
    """Return the types that a service consists of, as rosbags registers them.

    The one of the service's own name has its hash. `request` and `response` are (name, type) of each field.
    """
    asked, answered, event = (f"{service}_{part}" for part in ("Request", "Response", "Event"))
    return {
        asked: ([], _fields(request)),
        answered: ([], _fields(response)),
        event: ([], _fields((("info", _EVENT), ("request", f"{asked}[<=1]"), ("response", f"{answered}[<=1]")))),
        service: (
            [],
            _fields((("request_message", asked), ("response_message", answered), ("event_message", event))),
        ),
    }


@cache
def type_hash(name: str) -> str:
    """Return the hash of a type or a service, ``RIHS01_`` and 64 hex digits."""
    return store().hash_rihs01(name)


def _fields(fields: tuple[tuple[str, str], ...]) -> list[tuple[str, Any]]:
    return [(name, _described(kind)) for name, kind in fields]


def _described(kind: str) -> Any:
    """Return a field's type as rosbags describes it: a type, an array ``T[3]``, a sequence ``T[]`` or ``T[<=3]``."""
    from rosbags.interfaces import Nodetype

    element, bracket, count = kind.rstrip("]").partition("[")
    described: tuple[int, Any]
    described = (Nodetype.NAME, element) if "/" in element else (Nodetype.BASE, (element, 0))
    if not bracket:
        return described
    if count.isdigit():
        return (Nodetype.ARRAY, (described, int(count)))
    return (Nodetype.SEQUENCE, (described, int(count.removeprefix("<=") or 0)))
