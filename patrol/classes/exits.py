"""Foreign code must not end a process of ours, and certainly not with an exit code that says that all is well."""

from __future__ import annotations

import os
import posix
import sys
from functools import partial
from typing import NoReturn

end_now = os._exit
"""Ends the process at once, whatever foreign code is loaded."""


def keep_process() -> None:
    """Have `os._exit` raise SystemExit in this process from now on, as `sys.exit` does.

    Forks end as ever, and so does a worker of `multiprocessing` when its work is done.
    """
    os._exit = posix._exit = partial(_ask_to_exit, os.getpid())


def _ask_to_exit(kept: int, status: int) -> NoReturn:
    caller = str(sys._getframe(1).f_globals.get("__name__"))
    if os.getpid() != kept or caller.startswith("multiprocessing."):
        end_now(status)
    raise SystemExit(status)
