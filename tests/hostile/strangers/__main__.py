"""Attack small fleets of processes while they run, and tell whether they hold.

    python -m tests.hostile.strangers --minutes 30
    python -m tests.hostile.strangers --runs 1 --seed 8

A stranger stands beside each fleet. It holds no secret, a viewer's credentials, or those of one robot. It knocks, sends
garbage, reads along, floods, forges, replays, asks and stops reading. The fleet holds if nothing reaches the stranger
that is not meant for it, no process dies, hangs or takes 300 MB more than before, the verdict is valid, and in
lockstep the trace is that of the fleet without a stranger. A stranger with a robot's credentials may drive that robot,
and make the run invalid, if the verdict names that robot and no other.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from fogwatch.cli.ending import guarded
from fogwatch.run_folder.runfolder import RUNS, untaken
from runtime.process.lifeline import heed
from tests.hostile.strangers.session import HostileSession

MINUTES = 10.0
"""Minutes after which no fleet begins, unless minutes or runs are given."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Attack fleets; the exit code is 0 where all held, and 1 where at least one broke."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.hostile.strangers",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="exit codes: 0 all fleets held, 1 at least one broke, 2 bad input, 130 interrupted",
    )
    parser.add_argument("--runs", type=int, metavar="N", help="number of fleets (default: no limit)")
    parser.add_argument("--minutes", type=float, metavar="M", help=f"begin no fleet after M minutes ({MINUTES:g})")
    parser.add_argument(
        "--seed", type=int, default=1, metavar="K", help="of the first fleet; the next have K+1, ... (1)"
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder, new or empty, for fleets that break")
    options = parser.parse_args(arguments)
    limit = MINUTES if options.minutes is None and options.runs is None else options.minutes
    folder = (options.out or untaken(RUNS / f"strangers-{options.seed}")).absolute()
    # A signal ends the fleet in order; a second one raises KeyboardInterrupt wherever it is.
    ending = heed(None, patience=1)
    with HostileSession(folder, Console(), lambda: bool(ending)) as session:
        return session.run(options.seed, limit, options.runs)


if __name__ == "__main__":
    sys.exit(guarded(main))
