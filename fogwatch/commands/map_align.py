"""``fogwatch map align``: where one map lies on another. Raises BadInput; the caller prints it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fogwatch.cli.command_help import command
from fogwatch.cli.options import option
from fogwatch.commands.map import app, named_terrain
from patrol.errors import BadInput
from patrol.maps.builtins import LAYOUTS
from patrol.printable import printable
from patrol.starting.seldom import SELDOM
from patrol.starting.warmup import warm

if TYPE_CHECKING:
    from fogwatch.grounds.map_align import Place, WallMap
    from patrol.ground.terrain import Terrain
    from patrol.pose import Pose


MOST_OFF_M = 10.0
"""The largest tolerance of landmarks, m."""

APART_TOLERANCES = 10.0
"""Distance of the farthest two landmarks at least, in tolerances."""


@command(
    app,
    examples=[
        "fogwatch map align robot.yaml site.yaml --picture overlay.png",
        "fogwatch map align robot.yaml site.yaml --landmark 0.4,1.2=12.5,3 --landmark 7.9,1.2=12.5,10.5",
    ],
)
def align(
    own: Annotated[str, typer.Argument(metavar="A", help="The robot's map: a map file.")],
    ours: Annotated[str, typer.Argument(metavar="B", help=f"Our map: a map file, or one of {', '.join(LAYOUTS)}.")],
    landmark: Annotated[
        list[str] | None, option("AX,AY=BX,BY", "Place on A that is a place on B, in m. Repeatable; two or more.")
    ] = None,
    tolerance: Annotated[float, option("M", "How far landmarks may be off each other in m.")] = 0.3,
    point: Annotated[float, option("M", "Side of one grid point in m.")] = 0.1,
    picture: Annotated[Path | None, option("OUT.png", "Draw the maps over each other into this PNG file.")] = None,
) -> None:
    """Find where a robot's own map A lies on our map B: how far it is shifted and turned.

    By its walls, or by landmarks that both maps show, such as corners of rooms. The last line is the option that an
    agent of a robot with map A needs on map B (fogwatch agent --robot ros2). Look at the picture before you drive.
    """
    for name, value in (("point", point), ("tolerance", tolerance)):
        if not (math.isfinite(value) and value > 0.0):
            raise BadInput(f"--{name} = {value:g}: expected a finite number above 0, in m")
    if tolerance > MOST_OFF_M:
        raise BadInput(f"--tolerance = {tolerance:g}: allows anything; give at most {MOST_OFF_M:g}, in m")
    pairs = [_read_pair(text) for text in landmark or []]
    if picture is not None and picture.suffix.lower() != ".png":
        raise BadInput(f"--picture {picture}: expected a name that ends in .png")
    warm(("patrol",), lambda line: typer.echo(line, err=True), SELDOM)
    from fogwatch.grounds.map_align import (  # here: its library takes a while
        LEAST_AGREEMENT,
        agreement,
        align_maps,
        fit_landmarks,
        only_alignment,
        spelled,
        wall_map,
    )

    terrain_a, terrain_b = named_terrain(own, point), named_terrain(ours, point)
    if picture is not None:
        _check_picture(picture, (terrain_a, terrain_b))
    a, b = wall_map(terrain_a), wall_map(terrain_b)
    names = terrain_a.name, terrain_b.name
    if pairs:
        _check_places(pairs, (terrain_a, terrain_b), tolerance)
        transform, off_m = fit_landmarks(pairs)
        for number, (text, off) in enumerate(zip(landmark or [], off_m, strict=True), start=1):
            typer.echo(printable(f"landmark {number}, {text}: off by {off:.2f} m"))
        if max(off_m) > tolerance:
            worst = (landmark or [])[off_m.index(max(off_m))]
            raise BadInput(
                f"--landmark {worst}: off by {max(off_m):.2f} m, and --tolerance is {tolerance:g} m; correct the "
                "landmarks, of which at least one is wrong"
            )
        agree = agreement(a, b, transform)
        typer.echo(f"walls that agree: {agree:.0%}")
        if agree < LEAST_AGREEMENT:
            typer.echo("few walls agree at these landmarks; look at --picture before you drive by it", err=True)
    else:
        alignments = align_maps(a, b)
        if picture is not None and alignments:  # also of a place that is refused, so that people see why
            _draw_overlay(names, (a, b), alignments[0].transform, pairs, picture)
        best = only_alignment(alignments)
        transform = best.transform
        runner_up = f"; at the next best place {alignments[1].agreement:.0%}" if len(alignments) > 1 else ""
        typer.echo(f"walls that agree: {best.agreement:.0%}{runner_up}")
    if pairs and picture is not None:
        _draw_overlay(names, (a, b), transform, pairs, picture)
    turned = f"turned by {transform.heading:.4f} rad ({math.degrees(transform.heading):.1f} degrees)"
    typer.echo(printable(f"{own} on {ours}: its (0, 0) is at ({transform.x:.3f}, {transform.y:.3f}) m, {turned}"))
    typer.echo(f"--transform={spelled(transform)}")


def _check_places(pairs: list[tuple[Place, Place]], terrains: tuple[Terrain, Terrain], tolerance: float) -> None:
    """Refuse landmarks off their map, and landmarks so near to each other that they say little of the turn."""
    for terrain, places in zip(terrains, zip(*pairs, strict=True), strict=True):
        xmin, ymin, xmax, ymax = terrain.bounds
        for x, y in places:
            if not (xmin <= x <= xmax and ymin <= y <= ymax):
                span = f"spans x {xmin:g} to {xmax:g} m and y {ymin:g} to {ymax:g} m"
                raise BadInput(f"--landmark: ({x:g}, {y:g}) is not on {terrain.name}, which {span}")
    apart = max(math.dist(first, second) for first, _ in pairs for second, _ in pairs)
    if len(pairs) > 1 and apart < APART_TOLERANCES * tolerance:
        needed_m = APART_TOLERANCES * tolerance
        raise BadInput(
            f"--landmark: all lie within {apart:.2f} m on A; give some at least {needed_m:g} m apart, "
            "or a smaller --tolerance"
        )


def _check_picture(picture: Path, terrains: tuple[Terrain, Terrain]) -> None:
    """Refuse to draw over a map's own files."""
    from patrol.maps.map_file import read_map_file

    for terrain in terrains:
        if terrain.source is not None:
            image = read_map_file(terrain.source).image
            if picture.resolve() in (image.resolve(), Path(terrain.source).resolve()):
                raise BadInput(f"--picture {picture}: is a file of the map {terrain.name}; give another name")


def _draw_overlay(
    names: tuple[str, str],
    maps: tuple[WallMap, WallMap],
    transform: Pose,
    pairs: list[tuple[Place, Place]],
    picture: Path,
) -> None:
    from fogwatch.pictures.map_overlay import overlay_picture  # here: its library is an extra

    overlay_picture(names, *maps, transform, [on_b for _, on_b in pairs], picture)
    typer.echo(printable(f"picture: {picture}"))


def _read_pair(text: str) -> tuple[Place, Place]:
    places = [part.split(",") for part in text.split("=")]
    try:
        (ax, ay), (bx, by) = ((float(x), float(y)) for x, y in places)
    except ValueError:
        ax = ay = bx = by = math.nan
    if not all(map(math.isfinite, (ax, ay, bx, by))):
        raise BadInput(f"--landmark {text}: expected AX,AY=BX,BY in m, for example 0.4,1.2=12.5,3")
    return (ax, ay), (bx, by)
