"""``python -m ros2.sim``: simulated ROS 2 robots as a process."""

from ros2.sim.process import main
from runtime.process.lifeline import run_process

if __name__ == "__main__":
    run_process(main)
