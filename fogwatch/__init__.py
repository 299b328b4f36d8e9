"""The command `fogwatch` and its Python interface (docs/python-api.md).

The package also holds the launcher, which runs a fleet as separate processes, the router between them, the run folder
and the pictures. From Python:

    run = fogwatch.run("yards", overrides={"duration": 600})
    run.ticks.to_pandas().plot("time_s", "mfow_s")
"""

from __future__ import annotations

from fogwatch.own_packages import prefer_own_packages

TYPE_CHECKING = False  # typing's, which takes longer to load than all else until the command heeds Ctrl-C
if TYPE_CHECKING:
    from typing import Any

    from agent.ports import Bearing, Intent, Place, PolicySetup, Stay, Steer
    from agent.view import View
    from experiments.sweeps.result import SweepResult, sweep
    from fogwatch.api import run
    from fogwatch.notebook.run import Run, load
    from fogwatch.planning.result import PlanResult, plan
    from patrol.errors import BadInput
    from patrol.pose import Drive, Twist, Velocity

__all__ = ["BadInput", "Bearing", "Drive", "Intent", "Place", "PlanResult", "PolicySetup", "Run", "Stay", "Steer"]
__all__ += ["SweepResult", "Twist", "Velocity", "View", "load", "plan", "run", "sweep"]

_NAMES = {
    "agent.ports": "Bearing Intent Place PolicySetup Stay Steer",
    "agent.view": "View",
    "fogwatch.planning.result": "PlanResult plan",
    "experiments.sweeps.result": "SweepResult sweep",
    "fogwatch.api": "run",
    "fogwatch.notebook.run": "Run load",
    "patrol.errors": "BadInput",
    "patrol.pose": "Drive Twist Velocity",
}
"""The public names by module, imported on first use, so that child processes and short commands start quickly."""

_HOMES = {name: module for module, names in _NAMES.items() for name in names.split()}

_RENAMED = {"Result": "Run"}
"""Deprecated names and their successors: they warn, and go with version 2."""


prefer_own_packages()


def __dir__() -> list[str]:
    """List the public names too that are not imported yet, as notebooks complete them."""
    return sorted({*globals(), *__all__})


def __getattr__(name: str) -> Any:
    """Import a public name on first use."""
    if name in _RENAMED:
        import warnings

        new = _RENAMED[name]
        message = f"fogwatch.{name} is now fogwatch.{new}; the old name goes with fogwatch 2"
        warnings.warn(message, DeprecationWarning, stacklevel=2)
        name = new
    if name in _HOMES:
        from importlib import import_module

        package, _, module = _HOMES[name].partition(".")
        if package == "experiments":
            from patrol.extras import study

            return getattr(study(module), name)
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
