"""Garbage collection that keeps out of the way of a process's start and of its ticks.

Python's collector goes through all objects again and again while a process loads what it needs; nearly all of them
stay. Once numba is loaded there are more than a hundred thousand, and a full collection in the middle of a tick holds
the process up for a tenth of a second, which at a pace is all the time that a frame has. So a process collects nothing
until it is ready, and then leaves what it has loaded alone for good.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

_spares_what_is_loaded = False


def hold_collection() -> None:
    """Collect nothing until `begin_collection`; for a process that is about to load what it needs."""
    gc.disable()


def begin_collection() -> None:
    """Collect from now on, but nothing that is there already; without `hold_collection` before it this does nothing."""
    if not gc.isenabled():
        spare_what_is_loaded()
        gc.enable()


def spare_what_is_loaded() -> None:
    """Collect from now on, but nothing that is there already; for a process that has collected once all is loaded."""
    global _spares_what_is_loaded  # noqa: PLW0603 - there is one collector, and this says what has become of it
    gc.freeze()
    _spares_what_is_loaded = True


@contextmanager
def spared() -> Iterator[None]:
    """Collect nothing of what is there already while a block runs.

    It is for loops that last, over large structures that stay. What is garbage by then is collected first, since
    nothing would collect it in the block. A process that spares already what it has loaded, nearly all there is, goes
    on as it is: to go through all that once more would take longer than it saves.
    """
    if _spares_what_is_loaded:
        yield
        return
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
