"""The check that matplotlib, an optional dependency, can be used: one place for its remedies."""

from __future__ import annotations

import os

from patrol.errors import BadInput
from patrol.printable import printable


def check_matplotlib(extra: str) -> None:
    """Import matplotlib; where it cannot be, raise BadInput with the remedy.

    `extra` is the one of fogwatch's optional dependencies that brings matplotlib.
    """
    try:
        import matplotlib  # noqa: F401 - whether it can be imported
    except ImportError:
        raise BadInput(f"figures need matplotlib; install it with: pip install 'fogwatch[{extra}]'") from None
    except ValueError:
        backend = printable(os.environ.get("MPLBACKEND", ""))
        raise BadInput(f"MPLBACKEND={backend}: no backend of matplotlib; unset it, as figures need none") from None
