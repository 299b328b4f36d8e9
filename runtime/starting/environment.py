"""The environment of the processes that fogwatch starts, the command lines that ``ps`` shows, and the memory they keep.

Processes start with ``python -P``, so they do not look into the working folder. Only ``PYTHONPATH`` can still lead to a
file such as ``agent.py`` of the user's.

A forked process has the command line of another. The kernel shows what stands where a process's arguments once stood. A
process may write there, but gets no more room, so a process that is going to fork is started with an argument of blanks
(`room_for`).

Memory that is freed and soon needed again stays with a process. A decision works on pieces of grids, of up to a few MB,
and frees them. By default the C library gives large pieces back to the system at once, and learns as it goes which are
large, up to 32 MB: then pieces that are asked for now and then only, by a start or by a search of the whole ground,
stay for good as well. With a fixed limit of 8 MB an agent on `site` takes 90 MB instead of 112.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterable, Sequence
from contextlib import suppress
from importlib.machinery import PathFinder
from pathlib import Path

import patrol

PACKAGES = ("patrol", "runtime", "agent", "worldsim", "monitor", "ros2", "fogwatch", "experiments")
HOME = os.path.dirname(patrol.__path__[0])  # noqa: PTH120


def own_environment() -> dict[str, str]:
    """Return this process's environment, with our packages before any modules on ``PYTHONPATH`` that would hide them.

    ``python -m agent`` looks for `agent` before any code of ours runs, so only the order of folders can decide.
    """
    environment = dict(os.environ)
    if searched := environment.get("PYTHONPATH"):
        folders = searched.split(os.pathsep)
        hiding = next((index for index, folder in enumerate(folders) if _hides_a_package(folder)), None)
        if hiding is not None:
            # Just before the one that hides ours, so that all others keep their order.
            folders.insert(hiding, HOME)
            environment["PYTHONPATH"] = os.pathsep.join(folders)
    return environment


def _hides_a_package(folder: str) -> bool:
    """Return whether a folder holds a module that has the name of one of our packages, and is another."""
    for name in PACKAGES:
        spec = PathFinder.find_spec(name, [folder or "."])
        if spec is not None and spec.origin is not None:
            package_file = os.path.join(HOME, name, "__init__.py")  # noqa: PTH118
            if os.path.realpath(spec.origin) != os.path.realpath(package_file):
                return True
    return False


_START, _END = 48, 49
"""Fields of /proc/PID/stat, by proc(5), counted from 1."""
_NAMED = 2
"""The last field before those that can be split at blanks."""


def room_for(commands: Iterable[Sequence[str]]) -> str:
    """Return an argument of blanks that makes room for longer command lines; a longer one is cut short."""
    return " " * max(len(_join_words(words)) for words in commands)


def show_as(words: Sequence[str]) -> None:
    """Show a command line of this process from now on.

    Where the system does not say where it stands, nothing changes.
    """
    with suppress(OSError, ValueError, IndexError):
        # The second field is the program's name in brackets, which may hold blanks and brackets itself.
        fields = Path("/proc/self/stat").read_bytes().rpartition(b")")[2].split()
        start, end = (int(fields[number - _NAMED - 1]) for number in (_START, _END))
        if 0 < start < end:
            room = end - start
            ctypes.memmove(start, _join_words(words)[: room - 1].ljust(room, b"\0"), room)


def _join_words(words: Sequence[str]) -> bytes:
    return b"".join(word.encode(errors="replace") + b"\0" for word in words)


KEPT = 8 << 20
"""Bytes of the largest piece that agent and world keep, and of all that they keep at most."""

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3


def keep_freed_memory(most: int = KEPT) -> None:
    """Keep freed memory in small pieces from now on; where the C library is not glibc, nothing changes.

    `most` is in bytes: of the largest piece that is kept, and of all that is kept.
    """
    with suppress(OSError, AttributeError):
        set_option = ctypes.CDLL(None).mallopt
        set_option(_M_TRIM_THRESHOLD, most)
        set_option(_M_MMAP_THRESHOLD, most)
