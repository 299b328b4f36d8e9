"""``python -m agent``: one robot as a process."""

from agent.process import main
from patrol.process.lifeline import run_process

if __name__ == "__main__":
    run_process(main)
