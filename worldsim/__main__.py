"""``python -m worldsim``: the world as a process."""

from patrol.process.lifeline import run_process
from worldsim.process import main

if __name__ == "__main__":
    run_process(main)
