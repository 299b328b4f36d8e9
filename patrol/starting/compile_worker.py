"""``python -m patrol.starting.compile_worker``: compiles kernel modules, one after another.

Each line on the standard input is a JSON array of a module's name and its file. Each line on the standard output
answers one of them, with a JSON string that is empty or says what went wrong. `patrol.starting.compiling`
starts it.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from patrol.errors import BadInput
from patrol.kernel_cache import load_alone
from patrol.process.lifeline import die_when_orphaned


def main() -> None:
    """Compile what the parent names until it names no more."""
    die_when_orphaned(None)
    for line in sys.stdin:
        name, source = json.loads(line)
        error = ""
        try:
            load_alone(name, Path(source))
        except BadInput as bad:
            error = str(bad)
        except Exception as failed:  # noqa: BLE001 - a compiler may fail in any way; the parent reports it
            error = f"{source} cannot be compiled: {type(failed).__name__}: {failed}"
        sys.stdout.write(f"{json.dumps(error)}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
