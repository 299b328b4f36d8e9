"""The beginning of the command `fogwatch`: a robot's small computer loads its own command, and none of the others.

Loading takes half a second and more, in which the command can already be interrupted. So importing this module takes
over Ctrl-C before anything else is loaded; no other module may import it.
"""

from __future__ import annotations

import os
import signal
import sys
from os import _exit  # kept before foreign code may replace it


def _leave_process(_number: int, _frame: object) -> None:
    """End the process at once: there is nothing yet to put in order."""
    os.write(2, b"fogwatch: interrupted\n")
    _exit(130)  # runtime.process.failures.INTERRUPTED, which is not loaded yet


_HEEDS_CTRL_C = signal.getsignal(signal.SIGINT) is signal.default_int_handler
"""True if Ctrl-C is meant for this process; not so in the background of a shell."""

if _HEEDS_CTRL_C:
    signal.signal(signal.SIGINT, _leave_process)

PROCESSES = ("agent", "robot-sim", "router")
"""The commands of `fogwatch.commands.processes`, which stand on nothing that the other commands load."""


def main() -> int:
    """Run the command `fogwatch` with this process's arguments."""
    _settle_standard_streams()
    if not os.environ.get("COLUMNS", "80").isdigit() or not int(os.environ.get("COLUMNS", "80")):
        del os.environ["COLUMNS"]  # in no columns, rich prints nothing
    from fogwatch.cli.ending import run_app

    if len(sys.argv) > 1 and sys.argv[1] in PROCESSES:
        from fogwatch.cli.command_help import app
        from fogwatch.commands import processes  # noqa: F401 - adds its commands, and no other module does
    else:
        from fogwatch.cli.app import app

        if _HEEDS_CTRL_C:  # a robot's processes have nothing to put in order before they heed signals themselves
            from runtime.process.lifeline import interrupt

            signal.signal(signal.SIGINT, interrupt)
    code = run_app(app)
    if _HEEDS_CTRL_C:
        signal.signal(signal.SIGINT, _leave_process)  # while the interpreter puts itself away
    if "runtime.net.link" in sys.modules:
        from runtime.net.link import is_closing

        if is_closing():
            _exit(code)
    return code


def _settle_standard_streams() -> None:
    """Have a standard output and error that take every text, also where the caller has closed one of them.

    A file that is opened later would otherwise take the place of a closed one, and get what is printed. Where the
    locale has no UTF-8, characters that it lacks become escapes.
    """
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            opened = os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free, which is this one
            os.set_inheritable(opened, True)  # for children, which would have the stream closed otherwise
    sys.stdout = sys.stdout or os.fdopen(1, "w", encoding="utf-8", closefd=False)
    sys.stderr = sys.stderr or os.fdopen(2, "w", encoding="utf-8", errors="backslashreplace", closefd=False)
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(errors="backslashreplace")
