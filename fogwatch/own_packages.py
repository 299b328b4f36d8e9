"""The packages of fogwatch, preferred to a user's modules of the same names.

A script or a notebook has its own folder first on `sys.path`: a file ``agent.py`` or a folder ``monitor`` there would
be imported instead of our package.
"""

from __future__ import annotations

import sys
from importlib.machinery import ModuleSpec, PathFinder
from os import path

NAMES = ("patrol", "runtime", "agent", "worldsim", "monitor", "ros2", "experiments")
HOME = path.dirname(path.dirname(path.abspath(__file__)))  # noqa: PTH100, PTH120 - pathlib takes longer to load
_HIDDEN: set[str] = set()
"""The files that a line has named, so that each is named once."""


class OwnPackages:
    """A finder of modules that knows our packages alone, wherever `sys.path` leads."""

    @staticmethod
    def find_spec(name: str, _path: object = None, _target: object = None) -> ModuleSpec | None:
        """Return the spec of one of our packages, by its full name; None for any other module.

        A user's module that the package hides is named on the standard error output. Python's warnings do not serve
        here: under ``python -W error`` the import of our package would fail.
        """
        if name not in NAMES:
            return None
        own_spec, first = PathFinder.find_spec(name, [HOME]), PathFinder.find_spec(name)
        file = None if first is None else first.origin
        if file is not None and file not in _HIDDEN and not _is_own(name, file):
            _HIDDEN.add(file)
            line = f"fogwatch: {file}: fogwatch has a package of the name {name}, which hides this file; rename it"
            print(line, file=sys.stderr)
        return own_spec


def prefer_own_packages() -> None:
    """Have our packages found first from now on.

    ImportError if a user's module with the name of one of them is already imported.
    """
    for name in NAMES:
        module = sys.modules.get(name)
        file = getattr(module, "__file__", None) or next(iter(getattr(module, "__path__", ())), None)
        if file is not None and not _is_own(name, file):
            raise ImportError(f"{file}: fogwatch has a package of the name {name}; rename it", name=name, path=file)
    sys.meta_path.insert(0, OwnPackages)


def _is_own(name: str, file: str) -> bool:
    """Return whether a file is that of our package, perhaps by way of a symbolic link."""
    return path.realpath(file) == path.realpath(path.join(HOME, name, "__init__.py"))  # noqa: PTH118
