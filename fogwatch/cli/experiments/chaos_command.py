"""``fogwatch chaos``: many short random scenarios with random faults. Raises BadInput; the caller prints it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from patrol.errors import BadInput
from patrol.process.lifeline import heed
from patrol.values.types import MAX_SEED

EXAMPLES = [
    "fogwatch chaos --runs 20 --seed 100",
    "fogwatch chaos --runs 5 --processes",
]
EXIT_CODES = (
    "0 all scenarios held, 1 at least one broke, 2 bad input, 3 none broke but at least one was too slow to tell, "
    "130 interrupted"
)


def chaos(
    runs: Annotated[int, typer.Option(metavar="N", min=1, help="Number of random scenarios.")] = 100,
    seed: Annotated[
        int, typer.Option(metavar="K", min=0, help="Seed of the first scenario; the next have K+1, K+2, ...")
    ] = 1,
    processes: Annotated[
        bool, typer.Option("--processes", help="Run each scenario as a fleet of processes as well.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder, new or empty, for the scenarios that break (default: runs/chaos-K)."),
    ] = None,
) -> int:
    """Test fogwatch itself: run many short random scenarios with random faults, each in several ways.

    No run may fail, every verdict must be valid, and all ways of running a scenario must give the same trace. A
    scenario that breaks is reduced to fewer faults and written as a scenario file.
    """
    if seed + runs - 1 > MAX_SEED:
        raise BadInput(f"--seed {seed}: the last seed would be above 2^63 - 1; give a smaller one")
    from fogwatch.chaos_session import ChaosSession
    from fogwatch.launch.folder.runfolder import RUNS as FOLDER
    from fogwatch.launch.folder.runfolder import untaken

    heed(None, patience=0)  # any signal raises KeyboardInterrupt
    session = ChaosSession((out or untaken(FOLDER / f"chaos-{seed}")).absolute(), processes, Console())
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
