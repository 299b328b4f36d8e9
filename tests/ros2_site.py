"""A ROS 2 robot's router that asks who comes, with the robot, its agent and others at it."""

import time
from collections.abc import Callable
from typing import Any, TypeVar

import zenoh

from fogwatch.fleets.folder import ROBOT_ROUTER, FleetFolder, make_robot_router
from patrol.pose import Pose
from ros2.wire.formats import Format
from ros2.wire.link import ZenohRos2Link, open_ros2
from ros2.wire.mailbox import RosMailbox
from ros2.wire.messages import Odometry, Twist, TwistStamped
from ros2.wire.names import NodeName
from ros2.wire.ports import Sender
from runtime.security.credentials import Credentials, read_credentials
from tests.routers import PATIENCE_S, free_port

M = TypeVar("M")


def command(speed: float) -> TwistStamped:
    return TwistStamped(time.time_ns(), "base_link", Twist(speed, 0.0, 0.0))


def odometry(x: float) -> Odometry:
    return Odometry(time.time_ns(), "odom", "base_link", Pose(x, 0.0, 0.0), Twist(0.0, 0.0, 0.0))


class Site:
    """A robot's router that asks who comes, and sessions at it."""

    def __init__(self, fleet: FleetFolder, form: Format) -> None:
        self.form, self.fleet = form, fleet
        local, port = free_port(), free_port()
        folder = make_robot_router(fleet, "r1", form, "robot1", [], port, None, 1, local_port=local)
        self.router: zenoh.Session = zenoh.open(zenoh.Config.from_file(str(folder / ROBOT_ROUTER)))
        self.local, self.outside = f"tcp/127.0.0.1:{local}", f"tls/127.0.0.1:{port}"
        self._links: list[ZenohRos2Link] = []

    def robot(self, name: str = "base") -> ZenohRos2Link:
        """A program of the robot's own."""
        return self._join(self.local, name, None)

    def member(self, name: str) -> ZenohRos2Link:
        """A member of the fleet, over the network."""
        return self._join(self.outside, f"fogwatch_{name}", read_credentials(self.fleet.path / name, "test"))

    def _join(self, where: str, name: str, credentials: Credentials | None) -> ZenohRos2Link:
        link = open_ros2(where, self.form, NodeName(name, "robot1"), PATIENCE_S, credentials=credentials)
        self._links.append(link)
        return link

    def close(self) -> None:
        for link in self._links:
            assert link.close(PATIENCE_S)
        self.router.close()  # type: ignore[no-untyped-call]


def reach(sender: Sender[M], make: Callable[[], M], mailbox: RosMailbox[Any]) -> Any:
    end = time.monotonic() + PATIENCE_S
    while (received := mailbox.take(0.05)) is None:
        assert time.monotonic() < end
        sender.send(make())
    return received.message
