"""``fogwatch map regions``: how the ground splits into regions. Raises BadInput; the caller prints it."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from patrol.errors import BadInput
from patrol.ground.builtins import LAYOUTS
from patrol.ground.terrain import Terrain
from patrol.process.warmup import warm
from patrol.scenario import open_scenario

if TYPE_CHECKING:
    from patrol.regions.split import RegionSplit

MOST_LINES = 20
"""Regions listed."""


def regions(
    what: Annotated[
        str,
        typer.Argument(metavar="SCENARIO", help=f"A scenario file, a map or one of {', '.join(LAYOUTS)}."),
    ],
    point: Annotated[
        float | None, typer.Option(help="Side of one point of the grid in m (the scenario's, or 0.1).", metavar="M")
    ] = None,
    radius: Annotated[
        float | None, typer.Option(help="Radius of the body in m (the widest of the scenario's, or 1).", metavar="M")
    ] = None,
    picture: Annotated[Path | None, typer.Option(metavar="OUT.png", help="Draw the regions into this file.")] = None,
    polygons: Annotated[
        Path | None, typer.Option(metavar="OUT.yaml", help="Write them as a scenario's patrol section.")
    ] = None,
) -> None:
    """Split a map into convex regions for patrol.paths: regions, or check those that a scenario gives."""
    overrides: dict[str, object] = {}
    for name, value in (("point", point), ("radius", radius)):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise BadInput(f"--{name} = {value:g}: expected a finite number above 0, in m")
        if value is not None:
            overrides["point" if name == "point" else "robots.radius"] = value
    scenario = open_scenario(what, overrides)
    widest = max(spec.radius for spec in scenario.roster)
    warm(("patrol",), lambda line: typer.echo(line, err=True))
    from patrol.ground.fields import cspace_of  # these not before their kernels are compiled
    from patrol.ground.maps import load_terrain
    from patrol.regions.split import regions_by_hand, split_regions

    terrain = load_terrain(scenario.terrain, scenario.point, scenario.base)
    body = cspace_of(terrain, widest)
    given = scenario.patrol.regions
    begun = time.perf_counter()
    split = split_regions(terrain, body) if given is None else regions_by_hand(terrain, given)
    split = split.for_body(terrain, body)
    took = time.perf_counter() - begun
    for line in plain_lines(terrain, widest, split, took, given is not None):
        typer.echo(line)
    if polygons is not None:
        _write(polygons, split)
        typer.echo(f"polygons: {polygons}")
    if picture is not None:
        from fogwatch.pictures.region_map import region_picture  # here: its library is an extra

        region_picture(terrain, widest, split, picture)
        typer.echo(f"picture: {picture}")


def plain_lines(terrain: Terrain, radius: float, split: RegionSplit, took: float, by_hand: bool) -> Iterator[str]:
    """What there is to tell of a split, as lines of text. took: s."""
    xmin, ymin, xmax, ymax = terrain.bounds
    yield f"{terrain.name}: {xmax - xmin:g} x {ymax - ymin:g} m on points of {terrain.point:g} m; body of {radius:g} m"
    count = len(split.polygons)
    areas = np.bincount(split.labels[split.labels >= 0], minlength=count) * terrain.point_area
    entered = np.unique(split.labels[split.parts >= 0]).size
    how = "given" if by_hand else "found"
    yield f"regions: {_count(count, 'convex region')} {how} in {took:.2f} s; the body fits into {entered}"
    if count:
        smallest, middle, largest = areas.min(), float(np.median(areas)), areas.max()
        yield f"areas: {smallest:.1f} to {largest:.1f} m², half of them at least {middle:.1f} m²"
    yield f"connections: {len(split.connections)}"
    shown = np.argsort(-areas, kind="stable")[:MOST_LINES]
    for number in map(int, shown):
        x, y = (float(np.mean(values)) for values in zip(*split.polygons[number], strict=True))
        beside = sorted({other for link in split.connections if number in link.regions for other in link.regions})
        names = ", ".join(str(other) for other in beside if other != number) or "none"
        yield f"  {number}: {areas[number]:.1f} m² around ({x:.2f}, {y:.2f}), connected to {names}"
    if count > MOST_LINES:
        yield f"  and {count - MOST_LINES} smaller ones"


def _count(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


def _write(out: Path, split: RegionSplit) -> None:
    """The polygons as YAML that a scenario file can take over, to the millimetre."""
    corners = [", ".join(f"[{x:.3f}, {y:.3f}]" for x, y in polygon) for polygon in split.polygons]
    lines = ["patrol:", "  paths: regions", "  regions: # m", *(f"    - [{each}]" for each in corners), ""]
    try:
        out.write_text("\n".join(lines), encoding="utf-8")
    except OSError as error:
        raise BadInput(f"{out}: cannot be written ({error.strerror}); choose another file") from None
