"""``fogwatch chaos``: many short random scenarios with random faults, or a fleet under attack.

Raises BadInput; the caller prints it.
"""

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
    "fogwatch chaos --hostile --minutes 30",
]
EXIT_CODES = (
    "0 all scenarios held, 1 at least one broke, 2 bad input, 3 none broke but at least one was too slow to tell, "
    "130 interrupted"
)
RUNS = 100
"""Number of scenarios unless given."""
MINUTES = 10.0
"""Minutes of `--hostile` unless given."""


def chaos(
    runs: Annotated[
        int | None,
        typer.Option(
            metavar="N", min=1, help=f"Number of random scenarios (default: {RUNS}; no limit with --hostile)."
        ),
    ] = None,
    seed: Annotated[
        int, typer.Option(metavar="K", min=0, help="Seed of the first scenario; the next have K+1, K+2, ...")
    ] = 1,
    processes: Annotated[
        bool, typer.Option("--processes", help="Run each scenario as a fleet of processes as well.")
    ] = False,
    hostile: Annotated[
        bool, typer.Option("--hostile", help="Attack fleets of processes instead, while they run.")
    ] = False,
    minutes: Annotated[
        float | None,
        typer.Option(
            metavar="M", min=0.0, help=f"With --hostile: begin no fleet after M minutes (default: {MINUTES:g})."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder, new or empty, for the scenarios that break (default: runs/chaos-K)."),
    ] = None,
) -> int:
    """Test fogwatch itself: run many short random scenarios with random faults, each in several ways.

    No run may fail, every verdict must be valid, and all ways of running a scenario must give the same trace. A
    scenario that breaks is reduced to fewer faults and written as a scenario file.

    With --hostile, each scenario is a small fleet of processes with a stranger beside it, who holds no secret, a
    viewer's credentials, or those of one robot. It knocks, sends garbage, reads along, floods, forges, replays, asks
    and stops reading. The fleet holds if nothing reaches the stranger that is not meant for it, no process dies, hangs
    or takes 300 MB more than before, the verdict is valid, and in lockstep the trace is that of the fleet
    without a stranger. A stranger with a robot's credentials may make the run invalid, if the verdict names that robot
    and no other.
    """
    if minutes is not None and not hostile:
        raise BadInput("--minutes: is for --hostile; add it, or give --runs")
    if hostile:
        if processes:
            raise BadInput("--processes: fleets are always processes with --hostile; leave it out")
        return _hostile(runs, seed, minutes, out)
    count = RUNS if runs is None else runs
    if seed + count - 1 > MAX_SEED:
        raise BadInput(f"--seed {seed}: the last seed would be above 2^63 - 1; give a smaller one")
    from fogwatch.chaos_session import ChaosSession
    from fogwatch.launch.runfolder import RUNS as FOLDER
    from fogwatch.launch.runfolder import untaken

    heed(None, patience=0)  # any signal raises KeyboardInterrupt
    session = ChaosSession((out or untaken(FOLDER / f"chaos-{seed}")).absolute(), processes, Console())
    try:
        with session:
            session.begin(seed, count)
            for number in range(seed, seed + count):
                session.run(number, count)
    except KeyboardInterrupt:
        session.close(count)
        raise
    finally:
        session.tidy()
    return session.close(count)


def _hostile(runs: int | None, seed: int, minutes: float | None, out: Path | None) -> int:
    from fogwatch.hostile.session import HostileSession
    from fogwatch.launch.runfolder import RUNS as FOLDER
    from fogwatch.launch.runfolder import untaken

    # A signal ends the fleet in order; a second one raises KeyboardInterrupt wherever it is.
    ending = heed(None, patience=1)
    folder = (out or untaken(FOLDER / f"chaos-{seed}")).absolute()
    limit = MINUTES if minutes is None and runs is None else minutes
    with HostileSession(folder, Console(), lambda: bool(ending)) as session:
        return session.run(seed, limit, runs)
