"""Memory that is freed and soon needed again stays with the process.

A decision works on pieces of grids, of up to a few MB, and frees them. By default the C library gives large pieces back
to the system at once, and learns as it goes which are large. The next tick then gets them page by page and cleared
again, which once took a third of a decision's time on `site` at 10 cm. So pieces of that size stay. Larger ones are
asked for now and then only, by a start or by a search of the whole ground; they would stay for good as well, 80 MB of
them in an agent on `site`, and so they go back.
"""

from __future__ import annotations

import ctypes
from contextlib import suppress

KEPT = 8 << 20
"""Bytes of freed memory that a process keeps at most."""
LARGEST = 8 << 20
"""Bytes of the largest piece that is kept."""

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3


def keep_freed_memory() -> None:
    """Keep freed memory from now on; where the C library is not glibc, nothing changes."""
    with suppress(OSError, AttributeError):
        set_option = ctypes.CDLL(None).mallopt
        set_option(_M_TRIM_THRESHOLD, KEPT)
        set_option(_M_MMAP_THRESHOLD, LARGEST)
