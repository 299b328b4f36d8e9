"""``python -m agent``: one robot as a process."""

from agent.process import main
from patrol.lifeline import leave

if __name__ == "__main__":
    leave(main())
