"""A robot that is not ours: it speaks rmw_zenoh through zenoh-ros2-sdk, with definitions from a folder.

    python sdk_robot.py HOST PORT FOLDER

It sends odometry, and prints each command that it gets as a line of JSON, until its standard input ends.
"""

import importlib
import json
import sys
import threading
from typing import Any

import numpy as np

COMMAND, ODOMETRY = "geometry_msgs/msg/TwistStamped", "nav_msgs/msg/Odometry"


def main(host: str, port: str, folder: str) -> None:
    """Be the robot until the standard input ends."""
    sdk: Any = importlib.import_module("zenoh_ros2_sdk")
    sdk.get_registry(folder)
    there = {"router_ip": host, "router_port": int(port)}

    def command(message: Any) -> None:
        said = {"forward": message.twist.linear.x, "turn": message.twist.angular.z}
        print(json.dumps({"frame": message.header.frame_id, **said}), flush=True)

    session = sdk.ZenohSession.get_instance(**there)
    sdk.ROS2Subscriber("/robot1/cmd_vel", COMMAND, command, **there)
    odometry = sdk.ROS2Publisher("/robot1/odom", ODOMETRY, node_name="robot", namespace="/robot1", **there)
    ended = threading.Event()

    def read() -> None:
        sys.stdin.read()
        ended.set()

    threading.Thread(target=read, daemon=True).start()
    types = session.store.types
    position = types["geometry_msgs/msg/Point"](x=1.0, y=2.0, z=0.0)
    ahead = types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
    linear, angular = (types["geometry_msgs/msg/Vector3"](x=value, y=0.0, z=0.0) for value in (0.5, 0.0))
    while not ended.wait(0.1):
        stamp = types["builtin_interfaces/msg/Time"](sec=5, nanosec=7)
        odometry.publish(
            header=types["std_msgs/msg/Header"](stamp=stamp, frame_id="odom"),
            child_frame_id="base_link",
            pose=types["geometry_msgs/msg/PoseWithCovariance"](
                pose=types["geometry_msgs/msg/Pose"](position=position, orientation=ahead), covariance=np.zeros(36)
            ),
            twist=types["geometry_msgs/msg/TwistWithCovariance"](
                twist=types["geometry_msgs/msg/Twist"](linear=linear, angular=angular), covariance=np.zeros(36)
            ),
        )


if __name__ == "__main__":
    main(*sys.argv[1:])
