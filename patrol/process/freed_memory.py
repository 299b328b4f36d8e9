"""Memory that is freed and soon needed again stays with the process.

A decision works on whole grids, of 4 to 15 MB on a large terrain, and frees them. By default the C library gives such
pieces back to the system at once. The next tick then gets them page by page and cleared again, which took a third of a
decision's time on `site` at 10 cm.
"""

from __future__ import annotations

import ctypes
from contextlib import suppress

KEPT = 256 << 20
"""Bytes of freed memory that a process keeps at most."""
LARGEST = 32 << 20
"""Bytes of the largest piece that is kept; more than this the C library does not allow."""

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3


def keep_freed_memory() -> None:
    """Keep freed memory from now on; where the C library is not glibc, nothing changes."""
    with suppress(OSError, AttributeError):
        set_option = ctypes.CDLL(None).mallopt
        set_option(_M_TRIM_THRESHOLD, KEPT)
        set_option(_M_MMAP_THRESHOLD, LARGEST)
