"""The router between a fleet's processes: a Zenoh session that forwards messages. `fogwatch run` starts one.

Members of a mesh (`runtime.security.mesh`) need none.

    fogwatch router --fleet yards-1/router

It lets in the members of its fleet, and forwards what each may send to those who may have it. Without a fleet it lets
everybody do everything; beyond this machine it then starts only when it is told `--open`.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from patrol.errors import BadInput
from runtime.net.link import LinkDown, PortBusy, open_router
from runtime.process.context import PortTaken, ProcessContext, run_with
from runtime.process.lifeline import run_process
from runtime.process.options import ProcessParser
from runtime.reporting.logs import Log
from runtime.reporting.vitals import CONNECTIONS
from runtime.security.credentials import RouterSecurity, read_router
from runtime.security.keys import check_locator, fleet_keys, is_local

HELP = """
A fleet on several hosts needs a router where its robots cannot reach each other, or are many. Once, for all of them:

  fogwatch fleet init yards-1 --robots r1,r2 --host 192.168.1.10

On the router's host, and on every host of the fleet with the folder of its member:

  fogwatch router --fleet yards-1/router
  fogwatch agent --credentials yards-1/r1 --scenario yards.yaml

A fleet at two sites has a router at each, with the same folder. One connects to the other, and each process connects to
the router of its own site:

  fogwatch router --fleet yards-1/router --connect tls/192.168.1.10:7447
  fogwatch agent --credentials yards-1/r2 --router tls/192.168.2.10:7447 --scenario yards.yaml

Without --fleet anybody who can reach the router can read, send and forge everything.
"""

PULSE, PULSE_S = fleet_keys("router").alive("router"), 1.0
"""A liveliness token that the router asks its own tables for, to see that they answer, and how often, s."""

OPEN = "it is open: anybody who can reach {listen} can read, send and forge everything, positions and controls included"


CLOSE_S = 0.5
"""Longest time for closing, s: a client that has stopped reading holds it up, and launchers kill a slow router."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Route messages until asked to stop, and return the exit code.

    It is 0 after a stop, 2 for bad input or a port that cannot be listened on.
    """
    return run_with(router_parser().parse_args(arguments), "router", _route_messages, prefix="fogwatch router: ")


def _route_messages(process: ProcessContext) -> int:
    """Route until asked to stop; return the exit code."""
    listen, security = _read_security(process.options)
    linked_routers = _linked_routers(process.options, security)
    process.follow(**({} if security is None else {"fleet": security.keys.fleet}))
    try:
        router = open_router(listen, security, linked_routers)
    except PortBusy as busy:
        raise PortTaken(str(busy)) from None
    except LinkDown as down:
        raise BadInput(str(down)) from None
    process.vitals.probe(CONNECTIONS, lambda: router.connections)
    access = OPEN.format(listen=listen) if security is None else f"for the members of fleet {security.keys.fleet}"
    linked = f"; linked to {', '.join(linked_routers)}" if linked_routers else ""
    Log("router", "").announce(f"router ready at {listen}; {access}{linked}")
    process.ready(listen)
    alive = process.notifier.alive
    alive()
    answered = router.pulse(PULSE)
    while not process.ending.wait(PULSE_S):
        if answered():
            alive()
            answered = router.pulse(PULSE)
    process.closing.close()
    router.close(CLOSE_S)
    return 0


def _read_security(options: argparse.Namespace) -> tuple[str, RouterSecurity | None]:
    """Return the address to listen on and the security; None admits all. Raises BadInput where that would be unsafe."""
    if options.fleet is not None:
        if options.open:
            raise BadInput("--open: means that there is no --fleet; leave one of them out")
        security = read_router(options.fleet, "--fleet")
        listen = security.listen if options.listen is None else check_locator(options.listen, "--listen")
        return security.check_listen(listen), security
    listen = check_locator(options.listen or "tcp/127.0.0.1:7447", "--listen")
    if not options.open and not is_local(listen):
        raise BadInput(
            f"--listen {listen}: other machines could connect, and nobody would be asked who they are; give --fleet "
            "FOLDER, made by: fogwatch fleet init FOLDER --robots ... (or --open, to let everybody do everything)"
        )
    return listen, None


def _linked_routers(options: argparse.Namespace, security: RouterSecurity | None) -> list[str]:
    """Return the routers to connect to. Raises BadInput for an address that is none, or an unguarded link."""
    addresses = [check_locator(address, "--connect") for address in options.connect]
    for address in addresses:
        if security is not None:
            security.check_connect(address)
        elif not options.open and not is_local(address):
            raise BadInput(
                f"--connect {address}: nobody would be asked who they are; give --fleet FOLDER (or --open, to let "
                "everybody do everything)"
            )
    return addresses


def router_parser() -> ProcessParser:
    """Return the parser of the router's command line."""
    summary = "Forward messages between the processes of a fleet."
    parser = ProcessParser("fogwatch router", summary, HELP, reports_start=True)
    parser.add_argument(
        "--listen",
        metavar="tcp/HOST:PORT",
        help="address to listen on; 0.0.0.0 stands for all addresses of this host (default: the fleet's, or "
        "tcp/127.0.0.1:7447)",
    )
    parser.add_argument(
        "--fleet",
        type=Path,
        metavar="FOLDER",
        help="the router's folder, made by fogwatch fleet init: let in only the members of its fleet",
    )
    parser.add_argument(
        "--connect",
        action="append",
        default=[],
        metavar="tls/HOST:PORT",
        help="link to this fleet's router at another site, whenever it is there; repeatable",
    )
    parser.add_argument("--open", action="store_true", help="let everybody do everything, from other machines too")
    return parser


if __name__ == "__main__":
    run_process(main)
