"""Start the fogwatch agent of one robot.

    ros2 launch fogwatch_agent agent.launch.py connect:=tcp/127.0.0.1:7447 namespace:=robot1 map:=/maps/site.yaml \
        options:="--model differential --radius 0.2 --speed 0.3"

The agent talks with the robot over Zenoh alone. It is told to leave by SIGINT, as launch does at its end, and halts the
robot before it leaves.
"""

import shlex

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction
from launch.substitutions import LaunchConfiguration

ARGUMENTS = {
    "connect": {"description": "The robot's Zenoh router, such as tcp/127.0.0.1:7447."},
    "namespace": {"description": "The robot's namespace, such as robot1.", "default_value": ""},
    "map": {"description": "The map as map_server reads it, a YAML file; else the robot's own.", "default_value": ""},
    "options": {"description": "More options; see fogwatch agent --robot ros2 --help.", "default_value": ""},
}


def start_agent(context):
    """The agent's process.

    Args:
        context: Of the launch; it knows what the arguments were given.

    Returns:
        What launch runs.
    """
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    more = shlex.split(given.pop("options"))
    words = [word for name, value in given.items() if value for word in (f"--{name}", value)]
    command = ["fogwatch", "agent", "--robot", "ros2", *words, *more]
    return [ExecuteProcess(cmd=command, output="screen", sigterm_timeout="10")]


def generate_launch_description():
    """The arguments, and the agent's process.

    Returns:
        What launch runs.
    """
    declared = [DeclareLaunchArgument(name, **says) for name, says in ARGUMENTS.items()]
    return LaunchDescription([*declared, OpaqueFunction(function=start_agent)])
