"""Optional packages: matplotlib, and the studies. Where one is missing, the error names the extra."""

from __future__ import annotations

import os
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from patrol.errors import BadInput, printable


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
    _drop_settings_of_folder()


@cache
def _drop_settings_of_folder() -> None:
    """Use matplotlib's defaults where it has read settings in the working folder: those can start TeX."""
    import matplotlib as mpl

    if not Path(mpl.matplotlib_fname()).is_absolute():
        mpl.rcdefaults()


def study(name: str) -> Any:
    """Import a module of the studies, such as ``rivals.tours``; where it is missing, raise BadInput with the remedy.

    The studies are the package `experiments`. Nothing else imports it, so that a robot can do without.
    """
    try:
        return import_module(f"experiments.{name}")
    except ModuleNotFoundError as error:
        remedy = "install it with: pip install 'fogwatch[experiments]'"
        raise BadInput(f"{error.name} is not installed, and fogwatch's studies need it; {remedy}") from None
