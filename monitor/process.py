"""The page's process: it opens the source, serves it to browsers, and ends on request."""

from __future__ import annotations

import argparse
import os
import socket
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from monitor.replay.run_files import check_runs
from patrol.errors import BadInput
from runtime.process.context import ProcessContext, run_with
from runtime.process.failures import INTERRUPTED
from runtime.process.lifeline import Ending
from runtime.process.options import ProcessParser
from runtime.reporting.logs import Log, is_json
from runtime.reporting.supervision import Notifier
from runtime.reporting.vitals import Vitals
from runtime.starting.environment import keep_freed_memory

if TYPE_CHECKING:
    from monitor.observation.source import Source
    from monitor.page.authorisation import Authorisation

HELP = """
Serve the live page of a fleet, or of a run that is over:

  python -m monitor --access runs/yards-20260101-120000/control.json
  python -m monitor --credentials yards-1/viewer
  python -m monitor --router tcp/192.168.1.10:7447 --fleet yards-1
  python -m monitor --router tcp/192.168.1.10:7447 --fleet real-1 --scenario real.yaml
  python -m monitor --replay runs/yards-20260101-120000

The page is served to this machine only. Another address (--host) takes a token of 16 or more letters and digits, in the
environment variable FOGWATCH_PAGE_KEY. The page is not encrypted: use a network that you trust, or forward the port
with ssh.
Exit codes: 2 bad input, 130 interrupted.
"""

KEY = "FOGWATCH_PAGE_KEY"
"""Environment variable with the key, which gives the right to control; a random key is made when it is not set."""

READY = "page: "
"""Beginning of the line with the page's address."""

MAX_PORT = 65535
SHUTDOWN_S = 1
"""Longest wait for open connections to close, s."""

KEPT = 1 << 20
"""Bytes of the largest piece of freed memory that does not return to the system at once."""

NICENESS = 10
"""Difference by which a page's priority is below that of the fleet that it shows."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve one page."""
    # Taken out, so that no process that is started from here inherits it.
    key = os.environ.pop(KEY, "")

    def work(process: ProcessContext) -> int:
        process.follow()
        options = process.options
        serve(
            source_opener(options, process.ending),
            options.host,
            options.page_port,
            key,
            process.ending,
            announced=bool(key),
            key_name=KEY,
            opened=process.ready,
            vitals=process.vitals,
        )
        return INTERRUPTED

    return run_with(page_parser().parse_args(arguments), "monitor", work)


def serve(
    open_sources: Callable[[], Sequence[Source]],
    host: str,
    port: int,
    key: str,
    ending: Ending,
    *,
    announced: bool = False,
    key_name: str = "--token",
    opened: Callable[[str], None] = lambda _: None,
    vitals: Vitals | None = None,
) -> None:
    """Serve a page until asked to end.

    `open_sources` opens the source, or two for replays side by side; it returns none when asked to end meanwhile. Port
    0 is a free one. `key` gives the right to control, and an empty one is replaced by a random one. With `announced`
    the caller knows the key, so that the address is printed without it; `key_name` is the option or environment
    variable that holds it, for error messages. `opened` is called with the address once the page is served.
    """
    _check_libraries()
    from monitor.page.authorisation import MIN_TOKEN_LENGTH, Authorisation
    from runtime.security.keys import is_loopback

    local = is_loopback(host)
    if not local and not key:
        raise BadInput(f"--host {host}: other hosts could view the page; set {key_name}, or serve on 127.0.0.1")
    if key and len(key) < MIN_TOKEN_LENGTH:
        raise BadInput(f"{key_name}: has {len(key)} characters; give {MIN_TOKEN_LENGTH} or more, chosen at random")
    if key and not (key.isascii() and key.isalnum()):
        raise BadInput(f"{key_name}: has characters that do not fit into an address; use ASCII letters and digits only")
    listening = _open_listener(host, port)
    try:
        authorisation = Authorisation(host, listening.getsockname()[1], key or os.urandom(16).hex(), local)
        address = authorisation.address_without_key if announced else authorisation.address
        sources = open_sources()
        if sources:
            _run_server(sources, authorisation, listening, ending, address, opened, vitals)
    finally:
        listening.close()


def _check_libraries() -> None:
    """Raises BadInput where the libraries that serve a page are not installed."""
    for name in ("starlette", "uvicorn", "websockets"):
        if find_spec(name) is None:
            raise BadInput(f"the page needs {name}; install it with: pip install 'fogwatch[monitor]'")


def _run_server(
    sources: Sequence[Source],
    authorisation: Authorisation,
    listening: socket.socket,
    ending: Ending,
    address: str,
    opened: Callable[[str], None],
    vitals: Vitals | None,
) -> None:
    import asyncio

    import uvicorn
    from uvicorn.config import LOGGING_CONFIG

    from monitor.page.hub import Hub
    from monitor.page.server import MAX_MESSAGE, Server

    hubs = [Hub(source) for source in sources]
    if vitals is not None:
        hubs[0].show(vitals)
    config = uvicorn.Config(
        Server(hubs, authorisation).app,
        ws="websockets-sansio",
        ws_per_message_deflate=False,
        ws_max_size=4 * MAX_MESSAGE,
        log_config=None if is_json() else LOGGING_CONFIG,
        log_level="warning",
        access_log=False,
        server_header=False,
        lifespan="off",
        timeout_graceful_shutdown=SHUTDOWN_S,
    )
    server = uvicorn.Server(config)
    notifier = Notifier(os.environ)

    async def run() -> None:
        serving = asyncio.create_task(server._serve([listening]))  # serve() would take over the signals
        while not serving.done():
            notifier.alive()
            # The hubs run on threads of their own, whose failures nothing else would show.
            if ending or any(hub.failure is not None for hub in hubs):
                server.should_exit = True
            await asyncio.sleep(0.1)
        await serving

    for hub in hubs:
        hub.start()
    Log("monitor", "").announce(f"{READY}{address}")
    opened(address)
    try:
        asyncio.run(run())
    finally:
        for hub in hubs:
            hub.close()
    for hub in hubs:
        if hub.failure is not None:
            raise hub.failure


def source_opener(options: argparse.Namespace, ending: Ending) -> Callable[[], Sequence[Source]]:
    """Return a function that opens the source that the options name, or the two runs.

    The function returns none when asked to end before there is a source, and raises `BadInput`.
    """

    def open_sources() -> Sequence[Source]:
        from runtime.starting.warmup import warm

        keep_freed_memory(KEPT)
        if options.replay is not None:
            check_runs(options.replay)
        else:
            os.nice(NICENESS)  # before threads start: they keep their own priority
        warm(("patrol", "monitor"), Log("monitor", "").info)
        if options.replay is not None:
            from monitor.replay.player import open_player

            return [open_player(run, options.key) for run in options.replay]
        from monitor.live.attach import open_fleet

        fleet = open_fleet(
            ending,
            access=options.access,
            credentials=options.credentials,
            router=options.router,
            fleet=options.fleet,
            scenario=options.scenario,
            radio=options.radio,
            key=options.key,
            wait_s=options.wait,
        )
        return [] if fleet is None else [fleet]

    return open_sources


def _open_listener(host: str, port: int) -> socket.socket:
    """Return a listening socket; raises BadInput if there can be none."""
    if not 0 <= port <= MAX_PORT:
        raise BadInput(f"--page-port {port}: ports go from 1 to {MAX_PORT}; choose one of them, or 0 for a free one")
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        listening = socket.socket(family, kind, protocol)
        # Else a port that was in use just before would be refused for a minute.
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(address)
        listening.listen()  # early clients wait for the server
    except OSError as error:
        raise BadInput(
            f"--host {host} --page-port {port}: cannot listen there ({error.strerror}); choose another host or port"
        ) from None
    return listening


def page_parser() -> ProcessParser:
    """Return the parser of the page's command line."""
    parser = ProcessParser("python -m monitor", "", HELP, reports_start=True)

    def add(name: str, metavar: str, says: str, **more: Any) -> None:
        parser.add_argument(name, metavar=metavar, help=says, **more)

    add("--access", "FILE", "control.json of a running fleet; gives the right to control it", type=Path)
    add("--credentials", "FOLDER", "a viewer's, of a fleet made by: fogwatch fleet init; shows the fleet", type=Path)
    add("--router", "LOCATOR", "router of a running fleet, such as tcp/127.0.0.1:7447; needs --fleet")
    add("--fleet", "NAME", "name of the fleet at the router")
    add("--replay", "RUN", "folder of a run that is over, or of two to be shown side by side", type=Path, nargs="+")
    add("--key", "FILE", "key of the fleet, to check the tags of its messages (default: unchecked)", type=Path)
    add("--scenario", "FILE", "scenario of robots without a world, which are shown by their positions", type=Path)
    add("--radio", "LOCATOR|FOLDER", "where robots without a world exchange positions (default: the fleet's)")
    add("--host", "HOST", "address to serve on (default: 127.0.0.1)", default="127.0.0.1")
    add("--page-port", "N", "TCP port of the page (default: a free one)", type=int, default=0)
    add("--wait", "S", "how long to wait for the fleet, s (default: 60)", type=float, default=60.0)
    return parser
