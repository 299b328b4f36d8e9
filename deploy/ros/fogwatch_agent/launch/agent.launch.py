"""Start the fogwatch agent of one robot.

    ros2 launch fogwatch_agent agent.launch.py namespace:=robot1 map:=/maps/site.yaml connect:=tcp/127.0.0.1:7447

The agent talks with the robot over Zenoh alone. It is told to leave by SIGINT, as launch does at its end, and halts the
robot before it leaves.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration

ARGUMENTS = {
    "namespace": "The robot's namespace, such as robot1.",
    "map": "The map as map_server reads it, a YAML file.",
    "connect": "The robot's Zenoh router, such as tcp/127.0.0.1:7447.",
}


def generate_launch_description() -> LaunchDescription:
    """The agent's process, and the arguments that it is given.

    Returns:
        What launch runs.
    """
    declared = [DeclareLaunchArgument(name, description=says) for name, says in ARGUMENTS.items()]
    given = [word for name in ARGUMENTS for word in (f"--{name}", LaunchConfiguration(name))]
    agent = ExecuteProcess(cmd=["fogwatch", "agent", "--robot", "ros2", *given], output="screen", sigterm_timeout="10")
    return LaunchDescription([*declared, agent])
