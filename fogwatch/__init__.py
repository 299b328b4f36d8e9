"""The front door of the project.

The command `fogwatch`, the launcher that runs a fleet as separate processes, the router between them, the
run folder and the pictures. From Python:

    result = fogwatch.run("yards", overrides={"duration": 600})
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fogwatch.api import Result, run

__all__ = ["Result", "run"]


def __getattr__(name: str) -> Any:
    """Load what a run needs when somebody first asks for it, so that children and short commands start quickly."""
    if name in __all__:
        from fogwatch import api

        return getattr(api, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
