"""The beginning of the command `fogwatch`: a robot's small computer loads its own command, and none of the others."""

from __future__ import annotations

import sys

from fogwatch.cli.ending import run_app

PROCESSES = ("agent", "robot-sim")
"""The commands of `fogwatch.cli.fleets.process_commands`, which stand on nothing that the other commands load."""


def main() -> int:
    """Run the command `fogwatch` with this process's arguments.

    Returns:
        The exit code.
    """
    if len(sys.argv) > 1 and sys.argv[1] in PROCESSES:
        from fogwatch.cli.fleets.process_commands import only_these

        return run_app(only_these())
    from fogwatch.cli.app import app

    return run_app(app)
