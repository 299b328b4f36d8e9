"""``fogwatch chaos``: many short random scenarios under random faults. Raises BadInput; the caller prints it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from patrol.errors import BadInput
from patrol.process.lifeline import heed
from patrol.scenario.values import MAX_SEED


def chaos(
    runs: Annotated[int, typer.Option(metavar="N", min=1, help="How many random scenarios.")] = 100,
    seed: Annotated[int, typer.Option(metavar="K", min=0, help="Of the first; the next have K+1, K+2, ...")] = 1,
    processes: Annotated[bool, typer.Option("--processes", help="Run each as a fleet of processes too.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder, new or empty, for what breaks; runs/chaos-K unless given."),
    ] = None,
) -> int:
    """Run many short random scenarios with random faults of all kinds, each in several ways.

    None may fail, every verdict must be valid and all traces of a scenario equal. What breaks is narrowed down to
    fewer faults and written as a scenario file. Exit codes: 0 all held, 1 something broke, 2 bad input, 3 nothing
    broke but something was too slow to tell, 130 interrupted.
    """
    if seed + runs - 1 > MAX_SEED:
        raise BadInput(f"--seed {seed}: the last seed would be above 2^63 - 1; give less")
    from fogwatch.chaos_session import ChaosSession
    from fogwatch.launch.runfolder import RUNS, untaken

    heed(None, patience=0)  # any signal is KeyboardInterrupt, wherever we are
    session = ChaosSession((out or untaken(RUNS / f"chaos-{seed}")).absolute(), processes, Console())
    try:
        with session:
            session.begin(seed, runs)
            for number in range(seed, seed + runs):
                session.run(number, runs)
    except KeyboardInterrupt:
        session.close(runs)
        raise
    finally:
        session.tidy()
    return session.close(runs)
