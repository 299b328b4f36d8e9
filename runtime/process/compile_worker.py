"""``python -m runtime.process.compile_worker NICENESS``: compiles kernel modules, one after another.

Each line on the standard input is a JSON array of a module's name and its file. Each line on the standard output
answers one of them, with a JSON string that is empty or says what went wrong. `runtime.starting.compiling`
starts it.
"""

from __future__ import annotations

import gc
import json
import os
import sys
from pathlib import Path
from typing import Any

from numba.core import dispatcher

from patrol.errors import BadInput
from patrol.kernel_cache import load_alone
from runtime.process.lifeline import die_when_orphaned

OBJECTS = 50_000
"""New objects that make Python look for unreachable ones: by default 700, which takes a tenth of a compiler's time."""


def main() -> None:
    """Compile what the parent names until it names no more."""
    die_when_orphaned(None)
    os.nice(int(sys.argv[1]))
    gc.set_threshold(OBJECTS)
    numbas: Any = dispatcher
    numbas._FunctionCompiler._customize_flags = _leave_out_c_entry
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


def _leave_out_c_entry(_compiler: object, flags: Any) -> Any:
    """Compile no entry for callers in C, which no kernel has: that takes a twelfth of the time."""
    flags.no_cfunc_wrapper = True
    return flags


if __name__ == "__main__":
    main()
