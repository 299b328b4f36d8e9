"""The command `fogwatch` and its Python interface.

The package also holds the launcher, which runs a fleet as separate processes, the router between them, the run folder
and the pictures. From Python:

    result = fogwatch.run("yards", overrides={"duration": 600})
"""

from __future__ import annotations

TYPE_CHECKING = False  # typing's, which takes longer to load than all else until the command heeds Ctrl-C
if TYPE_CHECKING:
    from typing import Any

    from fogwatch.api import Result, run

__all__ = ["Result", "run"]


def __getattr__(name: str) -> Any:
    """Import what a run needs on first use, so that child processes and short commands start quickly."""
    if name in __all__:
        from fogwatch import api

        return getattr(api, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
