"""The router between a fleet's processes: a Zenoh session that forwards messages. `fogwatch run` starts one.

python -m fogwatch.router --listen tcp/0.0.0.0:7447
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from patrol.errors import BadInput
from patrol.net.keys import check_locator
from patrol.net.link import LinkDown, PortBusy, open_router
from patrol.process.lifeline import heed, run_process
from patrol.process.readiness import StartFailure, report_failure, report_ready

HELP = """
A fleet on several hosts needs one router that all of them can reach. On the router's host:

  python -m fogwatch.router --listen tcp/0.0.0.0:7447

and on every host of the fleet, with the address of the router's host:

  python -m agent --router tcp/192.168.1.10:7447 --fleet yards-1 --scenario yards.yaml --robot r1
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Route messages until asked to stop.

    Args:
        arguments: The command line; this process's own unless given.

    Returns:
        The exit code: 0 stopped, 2 bad input or a port that cannot be listened on.
    """
    options = _options(arguments)
    try:
        listen = check_locator(options.listen, "--listen")
        ending = heed(options.lifeline)
        router = open_router(listen)
    except (LinkDown, BadInput) as error:
        print(f"fogwatch router: {error}", file=sys.stderr)
        failure = StartFailure.PORT_BUSY if isinstance(error, PortBusy) else StartFailure.OTHER
        report_failure(options.ready, failure, str(error))
        return 2
    print(f"router ready at {listen}", flush=True)
    report_ready(options.ready, listen)
    while not ending.wait(3600.0):
        pass
    router.close()
    return 0


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m fogwatch.router",
        description="Forward messages between the processes of any number of fleets.",
        epilog=HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--listen",
        default="tcp/127.0.0.1:7447",
        metavar="tcp/HOST:PORT",
        help="address to listen on; 0.0.0.0 stands for all addresses of this host (default: %(default)s)",
    )
    parser.add_argument("--lifeline", type=int, metavar="FD", help="leave when this pipe ends (set by the launcher)")
    parser.add_argument("--ready", type=int, metavar="FD", help="report the start on this pipe (set by the launcher)")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    run_process(main)
