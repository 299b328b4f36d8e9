"""The command line that ``ps`` shows of a process, for processes that were forked and have that of another.

The kernel shows what stands where a process's arguments once stood. A process may write there, but gets no more room,
so a process that is going to fork is started with an argument of blanks (`room_for`).
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

_START, _END = 48, 49
"""Fields of /proc/PID/stat, by proc(5), counted from 1."""
_NAMED = 2
"""The last field before those that can be split at blanks."""


def room_for(commands: Iterable[Sequence[str]]) -> str:
    """Return an argument of blanks that makes room for longer command lines; a longer one is cut short."""
    return " " * max(len(_line(words)) for words in commands)


def show_as(words: Sequence[str]) -> None:
    """Show a command line of this process from now on.

    Where the system does not say where it stands, nothing changes.
    """
    with suppress(OSError, ValueError, IndexError):
        fields = Path("/proc/self/stat").read_bytes().rpartition(b")")[2].split()
        start, end = (int(fields[number - _NAMED - 1]) for number in (_START, _END))
        if 0 < start < end:
            room = end - start
            ctypes.memmove(start, _line(words)[: room - 1].ljust(room, b"\0"), room)


def _line(words: Sequence[str]) -> bytes:
    return b"".join(word.encode(errors="replace") + b"\0" for word in words)
