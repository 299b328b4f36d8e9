"""``python -m agent``: one robot as a process."""

from patrol.process.lifeline import run_process
from patrol.process.memory.freed_memory import keep_freed_memory
from patrol.process.memory.garbage import hold_collection

if __name__ == "__main__":
    keep_freed_memory()
    hold_collection()  # what follows loads much; `agent.process` begins to collect when it is ready

    from agent.process import main

    run_process(main)
