"""``python -m agent``: one robot as a process."""

from agent.process import main
from runtime.process.lifeline import run_process
from runtime.starting.environment import keep_freed_memory

if __name__ == "__main__":
    keep_freed_memory()
    run_process(main)
