"""The commands of the studies, as the command `fogwatch` has them."""

from __future__ import annotations

import typer

from experiments.commands import benchmark, experiment, intruder, map_random, paper, plan, reproduce, sweep
from fogwatch.cli.command_help import FINISHED, MANY, START, command


def register(app: typer.Typer, map_group: typer.Typer) -> None:
    """Add them to the command `fogwatch`, and to its group `map`."""
    app.add_typer(experiment.app, name="experiment", rich_help_panel=MANY)
    app.add_typer(paper.app, name="paper", rich_help_panel=MANY)
    command(app, examples=plan.EXAMPLES, exit_codes=plan.EXIT_CODES, panel=START)(plan.plan)
    command(app, examples=intruder.EXAMPLES, panel=FINISHED)(intruder.intruder)
    command(app, examples=sweep.EXAMPLES, exit_codes=sweep.EXIT_CODES, panel=MANY)(sweep.sweep)
    command(app, examples=benchmark.EXAMPLES, exit_codes=sweep.EXIT_CODES, panel=MANY)(benchmark.benchmark)
    command(app, examples=reproduce.EXAMPLES, exit_codes=reproduce.EXIT_CODES, panel=MANY)(reproduce.reproduce)
    command(map_group, examples=map_random.EXAMPLES)(map_random.random)
