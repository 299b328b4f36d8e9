"""The environment of the processes that fogwatch starts, in which its own packages are found.

They start with ``python -P``, so they do not look into the working folder. Only ``PYTHONPATH`` can still lead to a file
such as ``agent.py`` of the user's.
"""

from __future__ import annotations

import os
from importlib.machinery import PathFinder

import patrol

PACKAGES = ("patrol", "agent", "worldsim", "monitor", "ros2", "fogwatch", "experiments")
HOME = os.path.dirname(patrol.__path__[0])  # noqa: PTH120


def own_environment() -> dict[str, str]:
    """Return this process's environment, with our packages before any modules on ``PYTHONPATH`` that would hide them.

    ``python -m agent`` looks for `agent` before any code of ours runs, so only the order of folders can decide.
    """
    environment = dict(os.environ)
    if value := environment.get("PYTHONPATH"):
        folders = value.split(os.pathsep)
        hiding = next((index for index, folder in enumerate(folders) if _hides_a_package(folder)), None)
        if hiding is not None:
            folders.insert(hiding, HOME)
            environment["PYTHONPATH"] = os.pathsep.join(folders)
    return environment


def _hides_a_package(folder: str) -> bool:
    """Return whether a folder holds a module that has the name of one of our packages, and is another."""
    for name in PACKAGES:
        spec = PathFinder.find_spec(name, [folder or "."])
        if spec is not None and spec.origin is not None:
            own = os.path.join(HOME, name, "__init__.py")  # noqa: PTH118
            if os.path.realpath(spec.origin) != os.path.realpath(own):
                return True
    return False
