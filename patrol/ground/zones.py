"""Zones laid over the grid of a terrain."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from patrol.errors import BadInput
from patrol.ground.map_cells import touched_points
from patrol.ground.shapes import Polygon, cover
from patrol.ground.terrain import BoolGrid, Terrain


class Mask(Protocol):
    """The marked cells of a mask."""

    @property
    def resolution(self) -> float:
        """Side of a cell, m."""
        ...

    @property
    def origin(self) -> tuple[float, float]:
        """x and y of the lower left corner, m."""
        ...

    def marked(self) -> BoolGrid:
        """bool (rows, columns), the lowest row first."""
        ...


class Zone(Protocol):
    """Where a zone is: a scenario's `patrol.scenario.zones.ZoneSpec`."""

    @property
    def name(self) -> str:
        """Of the zone."""
        ...

    @property
    def polygon(self) -> Polygon | None:
        """Corners in m; None where there is a mask."""
        ...

    @property
    def mask(self) -> Mask | None:
        """The mask; None where there is a polygon."""
        ...

    @property
    def keep_out(self) -> bool | None:
        """True where no body may enter."""
        ...


def points_of(zone: Zone, terrain: Terrain) -> BoolGrid:
    """Return the points that share some area with a zone.

    Args:
        zone: The zone. A mask may have another resolution and another origin than the terrain.
        terrain: The ground.

    Returns:
        bool (height, width).
    """
    if zone.polygon is not None:
        return cover(zone.polygon, terrain.shape, terrain.point, terrain.origin)
    mask = zone.mask
    assert mask is not None
    start = terrain.origin[0] - mask.origin[0], terrain.origin[1] - mask.origin[1]
    return touched_points(mask.marked(), mask.resolution, terrain.point, terrain.shape, start)


def with_keep_outs(terrain: Terrain, zones: Iterable[Zone]) -> Terrain:
    """Return the terrain without the ground that zones keep bodies out of.

    Args:
        terrain: The ground.
        zones: All zones of the scenario.

    Raises:
        BadInput: A zone lies outside of the terrain, or no free space is left.
    """
    keep_out, kept_out = terrain.keep_out.copy(), []
    for number, zone in enumerate(zones):
        points = points_of(zone, terrain)
        if not points.any():
            xmin, ymin, xmax, ymax = terrain.bounds
            span = f"spans x {xmin:g} to {xmax:g} m and y {ymin:g} to {ymax:g} m"
            raise BadInput(f"zones.{number}: {zone.name} lies outside of {terrain.name}, which {span}; move or drop it")
        if zone.keep_out:
            keep_out |= points
            kept_out.append(zone.name)
    if not kept_out:
        return terrain
    kept = Terrain(terrain.name, terrain.passable, terrain.point, terrain.origin, keep_out, terrain.source)
    if not kept.free.any():
        names = ", ".join(kept_out)
        raise BadInput(f"zones: {names} keep robots out of all free space of {terrain.name}; leave some for the robots")
    return kept
