"""The packages of fogwatch, preferred to a user's modules of the same names.

A script or a notebook has its own folder first on `sys.path`: a file ``agent.py`` or a folder ``monitor`` there would
be imported instead of our package.
"""

from __future__ import annotations

import sys
from importlib.machinery import ModuleSpec, PathFinder
from os import path

NAMES = ("patrol", "agent", "worldsim", "monitor", "experiments")
HOME = path.dirname(path.dirname(path.abspath(__file__)))  # noqa: PTH100, PTH120 - pathlib takes longer to load
_WARNED: dict[str | tuple[str, type[Warning], int], int] = {}
"""The warnings given, so that each comes once."""


class OwnPackages:
    """A finder of modules that knows our packages alone, wherever `sys.path` leads."""

    @staticmethod
    def find_spec(name: str, _path: object = None, _target: object = None) -> ModuleSpec | None:
        """Find one of our packages, and warn of a user's module that it hides.

        Args:
            name: Of the module, in full.

        Returns:
            The package's spec; None for any other module.
        """
        if name not in NAMES:
            return None
        own, first = PathFinder.find_spec(name, [HOME]), PathFinder.find_spec(name)
        if own is not None and first is not None and first.origin not in (None, own.origin):
            import warnings

            message = f"fogwatch has a package of the name {name}, which hides this file; rename it"
            warnings.warn_explicit(message, UserWarning, first.origin, 1, registry=_WARNED)
        return own


def prefer_own_packages() -> None:
    """Have our packages found first from now on.

    Raises:
        ImportError: A module of the user's with the name of one of them is already imported.
    """
    for name in NAMES:
        file = getattr(sys.modules.get(name), "__file__", None)
        if file is not None and path.dirname(path.dirname(path.abspath(file))) != HOME:  # noqa: PTH100, PTH120
            raise ImportError(f"{file}: fogwatch has a package of the name {name}; rename it", name=name, path=file)
    sys.meta_path.insert(0, OwnPackages)
