"""Failures of processes and commands: exit codes, and one line in place of a traceback at limits such as a full disk.

Exit code 0 is success; 1 is a failure, such as an invalid verdict.
"""

from __future__ import annotations

import errno
import resource

from patrol.errors import BadInput

BAD_INPUT = 2
"""The input is wrong: one line on the standard error says what, and how to mend it."""

UNKNOWN = 3
"""Result unknown: a run that could not be judged, a scenario that was too slow to tell, a crash."""

CRASHED = 70
"""A process met a mistake of ours, with a traceback."""

INTERRUPTED = 130
"""A process was asked to leave."""

LEAST = 40
"""Files that one process of a fleet has open at once, sockets and pipes included, with room to spare."""

_ROOM = "free some space, or write elsewhere"
_REMEDIES = {
    errno.ENOSPC: _ROOM,
    errno.EDQUOT: _ROOM,
    errno.EROFS: "write elsewhere",
    errno.EFBIG: "raise the limit of a file's size (ulimit -f)",
    errno.EMFILE: "raise the limit of open files (ulimit -n)",
    errno.ENFILE: "end other programs, which have too many files open",
    errno.ENOMEM: "free some memory",
    errno.EAGAIN: "end other programs, or raise the limit of processes (ulimit -u)",
}


def told(error: BaseException) -> str | None:
    """Return one line on the limit that an error comes from, and the remedy; None where no limit explains it.

    For example ``run/journal: No space left on device; free some space, or write elsewhere``.
    """
    if isinstance(error, MemoryError):
        return "out of memory; free some, raise the limit (ulimit -v), or take coarser points or fewer robots"
    if not isinstance(error, OSError):
        return None
    remedy = _REMEDIES.get(error.errno or 0)
    if remedy is None:
        return None
    unnamed = "the output, or a file"
    if error.errno == errno.EAGAIN:
        if hasattr(error, "characters_written"):  # the output is a pipe that does not wait for its reader
            return f"the output: {error.strerror}; write to a file, or have it read faster"
        unnamed = "a new process"
    where = unnamed if error.filename is None else error.filename
    return f"{where}: {error.strerror}; {remedy}"


def allow_files(count: int, what: str) -> None:
    """Have this process, and those that it starts, allowed to open so many files at once.

    Beyond the limit, libraries abort or hang without an error.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft == resource.RLIM_INFINITY or soft >= count:
        return
    if hard != resource.RLIM_INFINITY and hard < count:
        raise BadInput(f"{what} needs {count} open files, and the limit is {hard}; raise it: ulimit -n {count}")
    # Only the soft limit: a process may raise that up to the hard one without any right.
    resource.setrlimit(resource.RLIMIT_NOFILE, (count, hard))
