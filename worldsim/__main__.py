"""``python -m worldsim``: the world as a process."""

from runtime.process.lifeline import run_process
from runtime.starting.environment import keep_freed_memory
from worldsim.process import main

if __name__ == "__main__":
    keep_freed_memory()
    run_process(main)
