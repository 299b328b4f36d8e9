"""``python -m agent``: one robot as a process."""

from agent.process import main
from patrol.process.lifeline import run_process
from patrol.starting.environment import keep_freed_memory

if __name__ == "__main__":
    keep_freed_memory()
    run_process(main)
