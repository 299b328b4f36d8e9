"""A robot that is a real node of ROS 2: two driven wheels, odometry from where it was switched on, a localisation.

    python base.py X Y HEADING [FRAME]

It obeys a velocity on ``cmd_vel`` for at most four steps, and stands when none has come since. A step moves it for
50 ms, however late it is, so that a busy machine lets it drive less and not further. Each is a line of JSON on its
standard output, with the true pose on the map, until SIGINT.
"""

import contextlib
import importlib
import json
import math
import sys
import time
from typing import Any

NAMESPACE = "robot1"
STEP_S, POSE_STEPS = 0.05, 4
TIMEOUT_STEPS = 4
"""Steps after which a robot without commands stands."""


def turned(orientation: Any, heading: float) -> None:
    orientation.z, orientation.w = math.sin(heading / 2.0), math.cos(heading / 2.0)


class Base:
    """The robot; what it says of itself goes by its own clock."""

    def __init__(self, rclpy: Any, start: tuple[float, float, float], frame: str) -> None:
        geometry, nav = importlib.import_module("geometry_msgs.msg"), importlib.import_module("nav_msgs.msg")
        self._odometry, self._pose = nav.Odometry, geometry.PoseWithCovarianceStamped
        self.start, self.frame = start, frame
        self.x = self.y = self.heading = 0.0
        self.speed = self.turn_rate = 0.0
        self.commands = self.steps = self.obeyed = self.timeouts = 0
        self.node = rclpy.create_node("base", namespace=NAMESPACE)
        latched = rclpy.qos.QoSProfile(depth=1, durability=rclpy.qos.DurabilityPolicy.TRANSIENT_LOCAL)
        self._odom = self.node.create_publisher(self._odometry, "odom", 10)
        self._amcl = self.node.create_publisher(self._pose, "amcl_pose", latched)
        self.node.create_subscription(geometry.TwistStamped, "cmd_vel", self.obey, 10)
        self.node.create_timer(STEP_S, self.step)

    def obey(self, message: Any) -> None:
        self.speed, self.turn_rate = message.twist.linear.x, message.twist.angular.z
        self.obeyed = self.steps
        self.commands += 1

    def step(self) -> None:
        if self.steps - self.obeyed >= TIMEOUT_STEPS:
            self.timeouts += self.speed != 0.0 or self.turn_rate != 0.0
            self.speed = self.turn_rate = 0.0
        self.heading += self.turn_rate * STEP_S
        self.x += self.speed * STEP_S * math.cos(self.heading)
        self.y += self.speed * STEP_S * math.sin(self.heading)
        stamp = self.node.get_clock().now().to_msg()
        odometry = self._odometry(child_frame_id="base_link")
        odometry.header.stamp, odometry.header.frame_id = stamp, "odom"
        odometry.pose.pose.position.x, odometry.pose.pose.position.y = self.x, self.y
        turned(odometry.pose.pose.orientation, self.heading)
        odometry.twist.twist.linear.x, odometry.twist.twist.angular.z = self.speed, self.turn_rate
        self._odom.publish(odometry)
        x0, y0, heading0 = self.start
        x = x0 + self.x * math.cos(heading0) - self.y * math.sin(heading0)
        y = y0 + self.x * math.sin(heading0) + self.y * math.cos(heading0)
        if self.steps % POSE_STEPS == 0:
            pose = self._pose()
            pose.header.stamp, pose.header.frame_id = stamp, self.frame
            pose.pose.pose.position.x, pose.pose.pose.position.y = x, y
            turned(pose.pose.pose.orientation, heading0 + self.heading)
            self._amcl.publish(pose)
        self.steps += 1
        said = {"x": x, "y": y, "heading": heading0 + self.heading, "speed": self.speed, "turn": self.turn_rate}
        counts = {"commands": self.commands, "timeouts": self.timeouts}
        print(json.dumps({**said, **counts, "at_s": time.time()}), flush=True)


def main(x: str, y: str, heading: str, frame: str = "map") -> None:
    rclpy: Any = importlib.import_module("rclpy")
    importlib.import_module("rclpy.executors")
    importlib.import_module("rclpy.qos")
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
        rclpy.spin(Base(rclpy, (float(x), float(y), float(heading)), frame).node)
    rclpy.try_shutdown()


if __name__ == "__main__":
    main(*sys.argv[1:])
