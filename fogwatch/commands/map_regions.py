"""``fogwatch map regions``: the split of the ground into regions. Raises BadInput; the caller prints it."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from fogwatch.cli.command_help import command
from fogwatch.cli.options import option
from fogwatch.commands.map import app
from patrol.errors import BadInput
from patrol.ground.terrain import Terrain
from patrol.maps.builtins import LAYOUTS
from patrol.printable import printable
from patrol.scenario import naming, open_scenario
from patrol.starting.seldom import SELDOM
from patrol.starting.warmup import warm

if TYPE_CHECKING:
    from patrol.regions.split import RegionSplit


MOST_LINES = 20
"""Regions listed at most."""


@command(app, examples=["fogwatch map regions yards --picture regions.png --polygons regions.yaml"])
def regions(
    what: Annotated[
        str, typer.Argument(metavar="SCENARIO", help=f"Scenario file, map file or one of {', '.join(LAYOUTS)}.")
    ],
    point: Annotated[
        float | None, option("M", "Side of one grid point in m (default: the scenario's, or 0.1).")
    ] = None,
    radius: Annotated[
        float | None, option("M", "Body radius in m (default: the largest of the scenario's robots, or 1).")
    ] = None,
    picture: Annotated[Path | None, option("OUT.png", "Draw the regions into this PNG file.")] = None,
    polygons: Annotated[
        Path | None, option("OUT.yaml", "Write the regions as the patrol section of a scenario.")
    ] = None,
) -> None:
    """Split a map into convex regions, or check the regions that a scenario gives.

    Robots use them with the policy potential-field and patrol.options.paths: regions.
    """
    overrides: dict[str, object] = {}
    for name, value in (("point", point), ("radius", radius)):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise BadInput(f"--{name} = {value:g}: expected a finite number above 0, in m")
        if value is not None:
            overrides["point" if name == "point" else "robots.radius"] = value
    scenario = open_scenario(what, overrides)
    widest = max(spec.radius for spec in scenario.roster)
    warm(("patrol",), lambda line: typer.echo(line, err=True), SELDOM)
    from patrol.ground.cspace import cspace_of  # here: these import kernels, which are compiled first
    from patrol.prepare import terrain_of
    from patrol.regions.split import regions_by_hand, split_regions

    with naming(what, overrides):
        terrain = terrain_of(scenario)
    body = cspace_of(terrain, widest)
    by_hand = scenario.patrol.regions
    begun = time.perf_counter()
    split = split_regions(terrain, body) if by_hand is None else regions_by_hand(terrain, by_hand)
    split = split.for_body(terrain, body)
    took = time.perf_counter() - begun
    for line in plain_lines(terrain, widest, split, took, by_hand is not None):
        typer.echo(line)
    if polygons is not None:
        _write_polygons(polygons, split)
        typer.echo(printable(f"polygons: {polygons}"))
    if picture is not None:
        from fogwatch.pictures.region_map import region_picture  # here: its library is an extra

        region_picture(terrain, widest, split, picture)
        typer.echo(printable(f"picture: {picture}"))


def plain_lines(terrain: Terrain, radius: float, split: RegionSplit, took: float, by_hand: bool) -> Iterator[str]:
    """Yield lines of text that describe a split of the ground into regions.

    `radius` is that of the body, m, and `took` the time of the split, s. `by_hand` says that the scenario gave the
    regions.
    """
    xmin, ymin, xmax, ymax = terrain.bounds
    size = f"{xmax - xmin:g} x {ymax - ymin:g} m, points of {terrain.point:g} m"
    yield f"{terrain.name}: {size}; body radius {radius:g} m"
    count = len(split.polygons)
    areas = np.bincount(split.labels[split.labels >= 0], minlength=count) * terrain.point_area
    entered = np.unique(split.labels[split.parts >= 0]).size
    how = "given" if by_hand else "found"
    yield f"regions: {_count_text(count, 'convex region')} {how} in {took:.2f} s; the body fits into {entered}"
    if count:
        smallest, middle, largest = areas.min(), float(np.median(areas)), areas.max()
        yield f"areas: {smallest:.1f} to {largest:.1f} m², median {middle:.1f} m²"
    yield f"connections: {len(split.connections)}"
    shown = np.argsort(-areas, kind="stable")[:MOST_LINES]
    for number in map(int, shown):
        x, y = (float(np.mean(values)) for values in zip(*split.polygons[number], strict=True))
        beside = sorted(
            {neighbour for link in split.connections if number in link.regions for neighbour in link.regions}
        )
        names = ", ".join(str(neighbour) for neighbour in beside if neighbour != number) or "none"
        yield f"  {number}: {areas[number]:.1f} m² around ({x:.2f}, {y:.2f}), connected to {names}"
    if count > MOST_LINES:
        yield f"  and {count - MOST_LINES} smaller ones"


def _count_text(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


def _write_polygons(out: Path, split: RegionSplit) -> None:
    """Write the polygons as YAML for a scenario file, to the millimetre."""
    corners = [", ".join(f"[{x:.3f}, {y:.3f}]" for x, y in polygon) for polygon in split.polygons]
    begin = ["patrol:", "  policy: potential-field", "  options:", "    paths: regions", "    regions: # m"]
    lines = [*begin, *(f"      - [{corner}]" for corner in corners), ""]
    try:
        out.write_text("\n".join(lines), encoding="utf-8")
    except OSError as error:
        raise BadInput(f"{out}: cannot be written ({error.strerror}); choose another file") from None
