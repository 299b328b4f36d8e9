"""``fogwatch map random``: maps of random buildings. Raises BadInput; the caller prints it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from experiments.random_limits import check_building
from fogwatch.cli.command_help import command
from fogwatch.cli.options import option
from fogwatch.commands.map import app
from patrol.errors import BadInput, printable
from patrol.starting.warmup import SELDOM, warm

MOST_BUILDINGS = 1000


@command(app, examples=["fogwatch map random maps --seed 101 --count 3"])
def random(
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Folder of the maps; made if it is missing.")],
    seed: Annotated[int, option("N", "Seed of the first building, from 0.")] = 1,
    count: Annotated[int, option("K", "Number of buildings, with seeds N to N + K - 1.")] = 1,
    radius: Annotated[float, option("M", "Radius of the body that fits through the doors, m.")] = 0.3,
    point: Annotated[float, option("M", "Side of one grid point in m, for runs too.")] = 0.1,
) -> None:
    """Write maps of random buildings whose openings are about as wide as a body, as randomN.yaml and randomN.pgm.

    The same seed, radius and point give the same building in every version. Use the files as any map: in a sweep's
    grid as terrain.map, in fogwatch benchmark with --terrains.
    """
    if not 1 <= count <= MOST_BUILDINGS:
        raise BadInput(f"--count {count}: expected a number of buildings from 1 to {MOST_BUILDINGS}")
    check_building(seed, radius, point, shown="--{}")
    warm(("patrol",), lambda line: typer.echo(line, err=True), SELDOM)
    from experiments.random_building import random_building  # here: it imports kernels, which are compiled first

    for number in range(seed, seed + count):
        building = random_building(number, radius, point)
        try:
            out.mkdir(parents=True, exist_ok=True)
            path = building.write(out, f"random{number}")
        except OSError as error:
            raise BadInput(f"{out}: cannot write a map there: {error.strerror}; choose another folder") from None
        xmin, ymin, xmax, ymax = building.terrain.bounds
        typer.echo(printable(f"{path}: {xmax - xmin:.1f} x {ymax - ymin:.1f} m"))
