"""``python -m ros2.robot``: the agent of a ROS 2 robot as a process."""

from ros2.robot import main
from runtime.process.lifeline import run_process
from runtime.starting.environment import keep_freed_memory

if __name__ == "__main__":
    keep_freed_memory()
    run_process(main)
