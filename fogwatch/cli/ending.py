"""How the command `fogwatch` ends: by the exit code of the command that it ran, or with one line that says why not."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import typer

from patrol.errors import BadInput
from patrol.process.exit_codes import BAD_INPUT, INTERRUPTED, UNKNOWN
from patrol.process.reporting.logs import crashed


def run_app(app: typer.Typer) -> int:
    """Run the command that this process's arguments name.

    Args:
        app: Has the command.

    Returns:
        The exit code.
    """
    code = guarded(lambda: app(standalone_mode=False))
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except BrokenPipeError:  # else the interpreter finds it while it ends and replaces any exit code by 120
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    return code


def guarded(call: Callable[[], Any]) -> int:
    """Run a command; an error that the user can mend becomes one line on the standard error.

    Args:
        call: Parses the arguments and runs the command that they name; returns its exit code.

    Returns:
        The exit code: the command's own, 2 for bad input, 3 for a crash, 130 when interrupted.
    """
    try:
        code = call()
    except BadInput as bad:
        complain(str(bad))
        return BAD_INPUT
    except (KeyboardInterrupt, typer.Abort):
        code = INTERRUPTED
    except BrokenPipeError:
        return 0
    except Exception as error:  # noqa: BLE001 - a crash leaves the run unjudged, not invalid
        if not hasattr(error, "format_message"):
            crashed(error)
            return UNKNOWN
        if message := error.format_message():  # without one it has printed the help
            complain(message)
        return BAD_INPUT
    if code == INTERRUPTED:  # typer may turn the signal into this code
        complain("interrupted")
    return code if isinstance(code, int) else 0


def complain(line: str) -> None:
    """Print a line on the standard error, unless nobody reads it.

    Args:
        line: What is wrong.
    """
    with suppress(BrokenPipeError):
        print(f"fogwatch: {line}", file=sys.stderr, flush=True)
