"""File pages that a process has mapped and no longer uses go back to the system.

A process maps whole files: libraries, and the grids that a launcher has prepared. What its start reads of them stays in
its memory, although much of it is never read again: of libllvmlite, which puts compiled kernels into the process, that
is most of its code. So the process gives all such pages back when it has loaded, before it opens connections. What it
still needs comes from the system's cache as it is used, which costs less than a millisecond altogether.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path

_MAPPINGS = Path("/proc/self/smaps")
_READ_ONLY = ("r--p", "r-xp", "r--s")
_CHANGED = {"Anonymous:", "Swap:"}
"""The lines of smaps that count changed pages. Where one of them is missing, nobody knows."""
_MADV_DONTNEED = 4


def give_back_file_pages() -> None:
    """Give back all pages of files of which this process cannot hold changes; outside Linux nothing happens.

    Called while no library's thread maps memory: that could take the place of a file that has just been seen.
    """
    with suppress(OSError, AttributeError):
        text = _MAPPINGS.read_text(encoding="utf-8", errors="replace")
        advise = ctypes.CDLL(None).madvise
        advise.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]
        for begin, end in unchanged(text.splitlines()):
            advise(begin, end - begin, _MADV_DONTNEED)


def unchanged(lines: Iterable[str]) -> Iterator[tuple[int, int]]:
    """The mappings of files whose pages can be read from the files again.

    What is mapped read-only may have been changed for this process all the same, by the linker, when it put a library
    together, or by a debugger. Such pages are anonymous, in memory or swapped out, and where there may be any, the
    whole mapping stays.

    Args:
        lines: Of smaps, see proc(5).

    Yields:
        The first address of each, and the one after its last.
    """
    mapping: tuple[int, int] | None = None
    without: set[str] = set()
    for line in lines:
        words = line.split(maxsplit=5)
        if not words[0].endswith(":"):
            is_file = len(words) > 5 and words[5].startswith("/")
            begin, _, end = words[0].partition("-")
            mapping = (int(begin, 16), int(end, 16)) if is_file and words[1] in _READ_ONLY else None
            without = set()
        elif words[1:2] == ["0"]:
            without.add(words[0])
        elif words[0] == "VmFlags:" and mapping is not None and without >= _CHANGED:
            yield mapping
