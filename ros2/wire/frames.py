"""Poses in frames: a pose of a child in its parent, put together with others. A frame is one of the plane (REP 105)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from patrol.errors import BadInput
from patrol.pose import TAU, Pose, wrap

if TYPE_CHECKING:
    from ros2.wire.messages import Twist

_SMALL_TURN = 1e-6


def pose_given(option: str, text: str, otherwise: str = "") -> Pose:
    """Return the pose that a command-line option gives as X,Y,HEADING in m and rad.

    `otherwise` tells the user what else the option takes.
    """
    try:
        x, y, heading = (float(part) for part in text.split(","))
    except ValueError:
        raise BadInput(
            f"{option} {text}: not a pose; give X,Y,HEADING in m and rad, such as 1.5,2,0{otherwise}"
        ) from None
    if not all(map(math.isfinite, (x, y, heading))):
        raise BadInput(f"{option} {text}: not finite; give X,Y,HEADING in m and rad, such as 1.5,2,0")
    return Pose(x, y, heading_given(f"{option} {text}: heading", heading))


def heading_given(where: str, heading: float) -> float:
    """Return a heading (rad) that a person or a file gives, wrapped to -pi to pi.

    More than a full turn is refused, since it was meant in degrees.
    """
    if abs(heading) > TAU:
        raise BadInput(f"{where} = {heading:g}: more than a full turn; give rad, for example 1.57 for 90 degrees")
    return wrap(heading)


def composed(outer: Pose, inner: Pose) -> Pose:
    """Return a pose in a frame, from the pose `inner` in a child frame and the child's own pose `outer`."""
    cos, sin = math.cos(outer.heading), math.sin(outer.heading)
    return Pose(
        outer.x + cos * inner.x - sin * inner.y,
        outer.y + sin * inner.x + cos * inner.y,
        wrap(outer.heading + inner.heading),
    )


def inverted(pose: Pose) -> Pose:
    """Return the pose of the parent in the child from that of the child in the parent."""
    cos, sin = math.cos(pose.heading), math.sin(pose.heading)
    return Pose(-cos * pose.x - sin * pose.y, sin * pose.x - cos * pose.y, wrap(-pose.heading))


def apart(pose: Pose, other: Pose) -> tuple[float, float]:
    """Return the distance of two poses, m, and the angle between their headings, rad."""
    return math.dist((pose.x, pose.y), (other.x, other.y)), abs(wrap(pose.heading - other.heading))


def travelled(pose: Pose, twist: Twist, time_s: float) -> Pose:
    """Return the pose of a body that keeps its velocity for a while: an exact arc.

    The velocity is in the body's own frame. A negative time gives the pose that the body came from.
    """
    turn = twist.turn_rate * time_s
    if abs(turn) < _SMALL_TURN:
        along, across = 1.0, 0.5 * turn
    else:
        along, across = math.sin(turn) / turn, (1.0 - math.cos(turn)) / turn
    x = (twist.vx * along - twist.vy * across) * time_s
    y = (twist.vx * across + twist.vy * along) * time_s
    return composed(pose, Pose(x, y, turn))
