"""Memory that a process did not have before."""

import mmap
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def fresh_memory(size: int) -> Iterator[None]:
    """Hold so many more bytes, all of them written to; an object's memory may be what another has freed."""
    with mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS) as held:
        for start in range(0, size, mmap.PAGESIZE):
            held[start] = 1
        yield
