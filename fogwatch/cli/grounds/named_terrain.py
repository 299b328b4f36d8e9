"""The terrain that an argument of a command names: a map's file, or a built-in one."""

from __future__ import annotations

from pathlib import Path

from patrol.errors import BadInput, did_you_mean
from patrol.ground.maps.builtins import LAYOUTS, builtin_terrain
from patrol.ground.terrain import Terrain


def named_terrain(what: str, point: float) -> Terrain:
    """Return the terrain of a map's YAML file, or one of `LAYOUTS`, with points of side `point`, m."""
    if what in LAYOUTS:
        return builtin_terrain(what, point)
    try:
        is_there = Path(what).exists()
    except OSError:  # such as a name that is too long
        is_there = False
    if not is_there:
        raise BadInput(f"{what}: no such map file, and no built-in terrain; {did_you_mean(what, tuple(LAYOUTS))}")
    from patrol.ground.maps.load import read_terrain

    return read_terrain(Path(what), point)
