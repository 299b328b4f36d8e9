"""The environment of the processes that fogwatch starts, in which its own packages are found.

They start with ``python -P``, so they do not look into the working folder. Only ``PYTHONPATH`` can still lead to a file
such as ``agent.py`` of the user's.
"""

from __future__ import annotations

import os
from importlib.machinery import PathFinder

import patrol

PACKAGES = ("patrol", "agent", "worldsim", "monitor", "experiments", "fogwatch")


def own_environment() -> dict[str, str]:
    """Return this process's environment, without folders of ``PYTHONPATH`` whose modules would hide our packages."""
    environment = dict(os.environ)
    if folders := environment.get("PYTHONPATH"):
        kept = [folder for folder in folders.split(os.pathsep) if not _hides_a_package(folder)]
        environment["PYTHONPATH"] = os.pathsep.join(kept)
    return environment


def _hides_a_package(folder: str) -> bool:
    """Return whether a folder holds a module that has the name of one of our packages, and is another."""
    home = os.path.dirname(patrol.__path__[0])  # noqa: PTH120
    specs = [(name, PathFinder.find_spec(name, [folder or "."])) for name in PACKAGES]
    return any(
        spec is not None and spec.origin not in (None, os.path.join(home, name, "__init__.py"))  # noqa: PTH118
        for name, spec in specs
    )
