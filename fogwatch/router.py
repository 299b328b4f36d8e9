"""The router between a fleet's processes: a Zenoh session that passes messages on. `fogwatch run` starts one.

python -m fogwatch.router --listen tcp/0.0.0.0:7447
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from patrol.errors import BadInput
from patrol.net.keys import check_locator
from patrol.net.link import LinkDown, open_router
from patrol.process.lifeline import heed, run_process

READY = "router ready at"

HELP = """
A fleet of several hosts needs one router that all can reach. On that host:

  python -m fogwatch.router --listen tcp/0.0.0.0:7447

and on every host of the fleet, with that host's address:

  python -m agent --router tcp/192.168.1.10:7447 --fleet yards-1 --scenario yards.yaml --robot r1
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Route until told to stop; the exit code."""
    options = _options(arguments)
    try:
        listen = check_locator(options.listen, "--listen")
        ending = heed(options.lifeline)
        router = open_router(listen)
    except LinkDown as down:
        print(f"fogwatch router: {down}", file=sys.stderr)
        return 2
    except BadInput as bad:
        print(f"fogwatch router: {bad}", file=sys.stderr)
        return 2
    print(f"{READY} {listen}", flush=True)
    while not ending.wait(3600.0):
        pass
    router.close()
    return 0


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m fogwatch.router",
        description="Pass messages between the processes of any number of fleets.",
        epilog=HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--listen",
        default="tcp/127.0.0.1:7447",
        metavar="tcp/HOST:PORT",
        help="where to listen; 0.0.0.0 for all of this host's addresses (default: %(default)s)",
    )
    parser.add_argument("--lifeline", type=int, metavar="FD", help="leave when this pipe ends (set by the launcher)")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    run_process(main)
