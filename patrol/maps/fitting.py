"""The reason why a body does not fit on a terrain, and remedies: other map settings, a smaller point or radius."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from patrol.ground.cspace import clearance_levels, cspace_of
from patrol.ground.terrain import Terrain

if TYPE_CHECKING:
    from patrol.ground.doors import Door

LEAST_SHARE = 0.05
"""The smallest point that is worth advising, as a share of the body's radius."""

MOST_TRIED = 10_000_000
"""Points of the finest grid on which it is tried whether a body fits."""

LEAST_RADIUS = 0.01
"""The smallest radius that is worth advising, m. Radii are advised in whole hundredths of a metre."""


def fits_nowhere(terrain: Terrain, radius: float, default: bool = False) -> str:
    """Return the error for a body that fits nowhere: one line with the cause and the remedy.

    `default` says that the radius is the default, as the scenario gives none.
    """
    largest_m = largest_radius(terrain)
    if why := _map_to_blame(terrain, f"a body with a radius of {radius:g} m"):
        return f"{why}; as it is, the largest radius that fits is {largest_m:g} m" if largest_m >= LEAST_RADIUS else why
    remedies = _finer_points(largest_m + 0.5 * terrain.point - radius, radius, terrain.point)
    # Only without other advice: to read the map again on finer points takes seconds.
    remedies = remedies or finer_points_where(terrain, radius, lambda finer: bool(cspace_of(finer, radius).any()))
    if largest_m >= LEAST_RADIUS:
        remedies.append(f"a radius of at most {largest_m:g} m")
    return (
        f"{_name_value(radius, default)}: a body this wide fits nowhere on {terrain.name}, on points of "
        f"{terrain.point:g} m; use {' or '.join(remedies or ['a smaller radius'])}"
    )


def fits_no_door(
    terrain: Terrain, radius: float, widest: Door, default: bool, is_let_out: Callable[[Terrain], bool]
) -> str:
    """Return the error for a body that fits through no door around the place where it would start.

    One line with the widest of these doors and the remedy. `is_let_out` tells whether the body fits through a door on
    the same ground with smaller points; `default` is as for `fits_nowhere`.
    """
    if why := _map_to_blame(terrain, f"a body with a radius of {radius:g} m to move"):
        return why
    passing = _floor_hundredths(widest.radius)
    lets = f"lets a radius of {passing:g} m pass" if passing >= LEAST_RADIUS else "lets no body pass"
    remedies = _finer_points(0.5 * widest.width - radius, radius, terrain.point)
    remedies = remedies or finer_points_where(terrain, radius, is_let_out)
    if passing >= LEAST_RADIUS or not remedies:
        remedies.append("your robot's own radius" if default else "a smaller radius")
    return (
        f"{_name_value(radius, default)}: too wide for every door of {terrain.name}, on points of {terrain.point:g} m; "
        f"the widest, at ({widest.x:.2f}, {widest.y:.2f}), is {widest.width:.2f} m wide and {lets}; use "
        f"{' or '.join(remedies)}, or give starts to patrol one room"
    )


def no_room_for_all(terrain: Terrain, radius: float, robots: int, why: str) -> str:
    """Return the error for a fleet that finds no room at the start: one line with the cause and the remedy.

    The radius is that of the robot for which there is no place left.
    """
    fleet = f"{robots} {'robot' if robots == 1 else 'robots'}"
    if to_blame := _map_to_blame(terrain, f"{fleet} with a radius of {radius:g} m"):
        return to_blame
    remedies = [*_finer_points(0.0, radius, terrain.point), "fewer or smaller robots"]
    return f"robots: {fleet} do not fit on {terrain.name}: {why}; use {', or '.join(remedies)}"


def _name_value(radius: float, default: bool) -> str:
    """Return the field with its value."""
    return f"robots.radius = {radius:g}{', the default' if default else ''}"


def _map_to_blame(terrain: Terrain, what: str) -> str:
    """Return the error where not the body but the settings of the terrain's map seem to be wrong; empty otherwise."""
    if terrain.source is None:
        return ""
    from patrol.maps.cells import read_image  # here: they need the image library
    from patrol.maps.doubts import wrong_settings
    from patrol.maps.map_file import read_map_file

    says = read_map_file(terrain.source)
    why = wrong_settings(says, read_image(says))
    return f"{terrain.source}: leaves no room for {what}: {why}" if why else ""


def largest_radius(terrain: Terrain) -> float:
    """Return the largest radius of a body that fits somewhere, in m, rounded down to hundredths; 0 for none."""
    level = int(clearance_levels(terrain.free, max(terrain.shape)).max())
    return _floor_hundredths(0.5 * terrain.point * (math.sqrt(level) - 1.0))


def _floor_hundredths(length: float) -> float:
    # the millionth: 100 times 0.29 is a little less than 29 in binary
    return max(math.floor(100.0 * length + 1e-6) / 100.0, 0.0)


def _finer_points(spare: float, radius: float, point: float) -> list[str]:
    """Return the advice to use smaller points; empty where points are no coarser than suits the body.

    A body needs half a point more than its radius, and a finer grid may be shifted against the place by a point.
    `spare` is half the width of the place less the radius, m.
    """
    finer = _nice_length(spare / 1.5) if spare > 0.0 else 0.0
    if finer < LEAST_SHARE * radius:  # whether the place is wide enough is unknown, unless points are coarse
        finer = _nice_length(0.25 * radius) if point > radius else 0.0
    return [_smaller_point(finer)] if 0.0 < finer < point else []


def finer_points_where(terrain: Terrain, radius: float, holds: Callable[[Terrain], bool]) -> list[str]:
    """Return the advice to use smaller points, for a map on which something holds with them.

    A corridor whose walls lie between points is up to two points wider than on the grid: one of 0.7 m from 0.25 to 0.95
    m has five whole points of 0.1 m, and fourteen of 0.05 m.
    """
    if terrain.source is None or terrain.keep_out.any():
        return []
    from patrol.maps.load import read_terrain  # here: it needs the image library

    finer = _nice_length(0.5 * terrain.point)
    while finer >= LEAST_SHARE * radius and terrain.passable.size * (terrain.point / finer) ** 2 <= MOST_TRIED:
        if holds(read_terrain(terrain.source, finer)):
            return [_smaller_point(finer)]
        finer = _nice_length(0.5 * finer)
    return []


def _smaller_point(point: float) -> str:
    return f"a smaller point, such as --point {point:g}"


def _nice_length(length: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that is not above a length.

    For example, 0.05 for 0.07, and 0.2 for 0.3.
    """
    power = 10.0 ** math.floor(math.log10(length))
    return next(factor * power for factor in (5.0, 2.0, 1.0) if factor * power <= length * (1.0 + 1e-9))
