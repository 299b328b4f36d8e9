"""``python -m worldsim.ros2``: simulated ROS 2 robots as a process."""

from patrol.process.lifeline import run_process
from worldsim.ros2.process import main

if __name__ == "__main__":
    run_process(main)
