r"""Opening files that others may have written: regular files only, and never more bytes than their kind may have.

A path that a user gives, or that a file names, can lead to anything. Opening a named pipe waits for a process that
writes to it, opening some devices does something, others have no end, and a file may be larger than the memory. So
every file that is not this program's own is opened here, and a test finds code that opens files elsewhere. A file is
looked at before it is opened, and opened only if it is a regular one within the limit of its kind.

Such text may spell half of a character, a lone surrogate, as JSON, YAML and Python do (``"\ud800"``). It cannot be
encoded in UTF-8, so whatever writes, sends or hashes it fails, far from where it came in. Readers of other people's
text refuse it here.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from patrol.errors import BadInput, Unusable, quoted

KIB = 1 << 10
MIB = 1 << 20
GIB = 1 << 30


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of file."""

    what: str  # what errors call such a file, such as "a map's image"
    most: int  # bytes of the largest one


SCENARIO = Kind("a scenario", 2 * MIB)
SWEEP = Kind("a sweep", 2 * MIB)
MAP = Kind("a map's YAML file", 64 * KIB)
POSE = Kind("a file with a pose", MIB)
GRAPH = Kind("a graph", MIB)
IMAGE = Kind("a map's image", 512 * MIB)
PICTURE = Kind("a picture", 8 * MIB)
KEY = Kind("a key", 4 * KIB)
CERTIFICATE = Kind("a certificate or its key", 64 * KIB)
ACCESS = Kind("an access file", 64 * KIB)
OWN_CLASS = Kind("a Python file", 16 * MIB)
WEIGHTS = Kind("a trained network", 64 * MIB)
SUMMARY = Kind("a summary", 8 * MIB)
JOURNAL = Kind("a journal", 64 * GIB)
BAG = Kind("a bag", 64 * GIB)
RESULTS = Kind("a sweep's results", GIB)

_NAMES = (
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)


class FileRefused(Unusable, OSError):
    """A file that is not opened, or not read, although the system would; `strerror` says why."""


def open_untrusted(path: Path, kind: Kind) -> BinaryIO:
    """Open a file for reading.

    Journals and bags, which are read piece by piece, have limits of their own for each piece. Raises FileRefused,
    an OSError, for anything but a regular file, and for one larger than its kind may be.
    """
    try:
        path_only = os.open(path, os.O_PATH | os.O_CLOEXEC)  # finds the file without opening it
    except ValueError:
        raise FileRefused(errno.EINVAL, "has a null character in its name", str(path)) from None
    try:
        check_regular(path_only, path, kind)
        # By its descriptor, so that it is the file that was checked, whatever the path leads to by now.
        return os.fdopen(os.open(f"/proc/self/fd/{path_only}", os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb")
    except OSError as error:
        raise type(error)(error.errno, error.strerror, str(path)) from None
    finally:
        os.close(path_only)


def check_regular(descriptor: int, path: Path, kind: Kind) -> None:
    """Check that an open file is a regular one within the limit of its kind.

    Raises IsADirectoryError for a folder, and FileRefused for all else.
    """
    facts = os.fstat(descriptor)
    if stat.S_ISDIR(facts.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(facts.st_mode):
        kind_of_file = next((name for holds, name in _NAMES if holds(facts.st_mode)), "something else")
        raise FileRefused(errno.EINVAL, f"is {kind_of_file}; give a regular file", str(path))
    if facts.st_size > kind.most:
        raise _too_large(path, kind)


def read_untrusted(path: Path, kind: Kind) -> bytes:
    """Read the bytes of a file; its errors are those of `open_untrusted`."""
    with open_untrusted(path, kind) as file:
        content = file.read(kind.most + 1)  # some regular files, as in /proc, do not say how large they are
    if len(content) > kind.most:
        raise _too_large(path, kind)
    return content


def _too_large(path: Path, kind: Kind) -> FileRefused:
    unit, name = next((unit, name) for unit, name in ((GIB, "GiB"), (MIB, "MiB"), (KIB, "KiB")) if kind.most >= unit)
    return FileRefused(errno.EFBIG, f"is larger than {kind.what} may be, {kind.most // unit} {name}", str(path))


def leads_out(folder: Path, path: Path) -> bool:
    """Return True if a path, which need not exist, leads out of a folder, by its names or by a link."""
    return not Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder))


_HALF_REMEDY = "holds half of a character (a lone surrogate, or a byte that is not UTF-8); write whole characters"


def refuse_half_characters(value: Any, source: str) -> None:
    """Refuse lone surrogates in the keys and values of plain data."""
    waiting: list[tuple[str, Any]] = [("", value)]
    seen_ids: set[int] = set()
    while waiting:
        field, part = waiting.pop()
        inner: list[tuple[Any, Any]] = []
        if isinstance(part, str) and _is_half(part):
            where = f"{source}: {field} = " if field else f"{source}: "
            raise BadInput(f"{where}{quoted(part)}: {_HALF_REMEDY}")
        if isinstance(part, Mapping | list | tuple) and id(part) not in seen_ids:
            seen_ids.add(id(part))
            inner = list(part.items() if isinstance(part, Mapping) else enumerate(part))
        for key, child in reversed(inner):
            if isinstance(key, str) and _is_half(key):
                raise BadInput(f"{source}: key {quoted(key)}{f' of {field}' if field else ''}: {_HALF_REMEDY}")
            waiting.append((f"{field}.{key}" if field else str(key), child))


def _is_half(text: str) -> bool:
    try:
        text.encode()
    except UnicodeEncodeError:
        return True
    return False
