"""The process around the page: it opens what there is to see, serves it to browsers, and leaves when it is told to."""

from __future__ import annotations

import argparse
import ctypes
import os
import socket
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from monitor.replay.runfiles import journal_in
from patrol.errors import BadInput
from patrol.process.lifeline import INTERRUPTED, Ending, heed
from patrol.process.readiness import report_ready

if TYPE_CHECKING:
    from monitor.page.gate import Gate
    from monitor.source import Source

HELP = """
The live page of a fleet, or of a run that is over:

  python -m monitor --access runs/yards-20260101-120000/control.json
  python -m monitor --router tcp/192.168.1.10:7447 --fleet yards-1
  python -m monitor --router tcp/192.168.1.10:7447 --fleet real-1 --scenario real.yaml
  python -m monitor --replay runs/yards-20260101-120000

It serves this machine alone. On another address (--host) it needs a token, in the environment variable
FOGWATCH_PAGE_KEY; what it sends is not encrypted, so use a network that you trust, or forward the port with ssh.
Exit codes: 2 bad input, 130 told to leave.
"""

KEY = "FOGWATCH_PAGE_KEY"
"""The environment variable with what proves the right to ask for anything; where there is none, one is drawn."""

READY = "page: "
"""What the line with the address begins with."""

MOST_PORTS = 65535
FAREWELL_S = 1

_M_MMAP_THRESHOLD = -3
LARGE = 1 << 20
"""Bytes from which on memory goes back to the system as soon as it is free."""

GIVES_WAY = 10
"""How much nicer than the fleet that it watches a page is."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve one page; the exit code."""
    options = _options(arguments)
    ending = heed(options.lifeline)
    key = os.environ.pop(KEY, "")
    try:
        opened = partial(report_ready, options.ready)
        show(opener(options, ending), options.host, options.port, key, ending, announced=bool(key), opened=opened)
    except BadInput as bad:
        print(f"monitor: {bad}", file=sys.stderr)
        return 2
    return INTERRUPTED


def show(
    open_source: Callable[[], Source | None],
    host: str,
    port: int,
    key: str,
    ending: Ending,
    *,
    announced: bool = False,
    opened: Callable[[str], None] = lambda _: None,
) -> None:
    """Serve a page until asked to end.

    open_source: None when it was asked to end meanwhile. port: 0 for a free one. key: empty to have one drawn.
    announced: whoever started this knows the key, so the address is printed without it. opened: told the address.
    """
    from monitor.page.gate import LEAST_TOKEN, Gate
    from patrol.net.keys import is_loopback

    alone = is_loopback(host)
    if not alone and not key:
        raise BadInput(f"--host {host}: others could look and ask for faults; give a --token too, or stay on 127.0.0.1")
    if key and len(key) < LEAST_TOKEN:
        raise BadInput(f"--token: has {len(key)} letters; give {LEAST_TOKEN} or more, drawn by lot")
    if key and not (key.isascii() and key.isalnum()):
        raise BadInput("--token: give letters and digits only, so that it fits into an address")
    place = _listen(host, port)
    try:
        gate = Gate(host, place.getsockname()[1], key or os.urandom(16).hex(), alone)
        source = open_source()
        if source is not None:
            _serve(source, gate, place, ending, gate.plain if announced else gate.address, opened)
    finally:
        place.close()


def _serve(
    source: Source, gate: Gate, place: socket.socket, ending: Ending, address: str, opened: Callable[[str], None]
) -> None:
    import asyncio

    import uvicorn

    from monitor.page.hub import Hub
    from monitor.page.server import LONGEST, Server

    hub = Hub(source)
    config = uvicorn.Config(
        Server(hub, gate).app,
        ws="websockets-sansio",
        ws_per_message_deflate=False,
        ws_max_size=4 * LONGEST,
        log_level="warning",
        access_log=False,
        server_header=False,
        lifespan="off",
        timeout_graceful_shutdown=FAREWELL_S,
    )
    server = uvicorn.Server(config)

    async def serve() -> None:
        serving = asyncio.create_task(server._serve([place]))  # serve() itself would take the signals over
        while not serving.done():
            if ending or hub.failure is not None:
                server.should_exit = True
            await asyncio.sleep(0.1)
        await serving

    hub.start()
    print(f"{READY}{address}", flush=True)
    opened(address)
    try:
        asyncio.run(serve())
    finally:
        hub.close()
    if hub.failure is not None:
        raise hub.failure


def opener(options: argparse.Namespace, ending: Ending) -> Callable[[], Source | None]:
    """What opens the source that the options name."""

    def open_source() -> Source | None:
        from patrol.process.warmup import warm

        _free_at_once()
        if options.replay is not None:
            journal_in(options.replay)
        warm(("patrol", "monitor"), lambda line: print(line, file=sys.stderr, flush=True))
        if options.replay is not None:
            from monitor.replay.player import open_player

            return open_player(options.replay)
        from monitor.live.attach import open_fleet

        os.nice(GIVES_WAY)  # before there are threads, which would not follow
        return open_fleet(
            ending,
            access=options.access,
            router=options.router,
            fleet=options.fleet,
            scenario=options.scenario,
            radio=options.radio,
            wait_s=options.wait,
        )

    return open_source


def _free_at_once() -> None:
    """Have maps that are not needed any more freed: GNU's C library would keep 32 MB pieces between what is needed."""
    with suppress(AttributeError, OSError):  # another C library
        ctypes.CDLL(None).mallopt(_M_MMAP_THRESHOLD, LARGE)


def _listen(host: str, port: int) -> socket.socket:
    """A socket that listens there; BadInput where that cannot be."""
    if not 0 <= port <= MOST_PORTS:
        raise BadInput(f"--page-port {port}: ports go from 1 to {MOST_PORTS}; choose one of them, or 0 for a free one")
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        place = socket.socket(family, kind, protocol)
        place.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        place.bind(address)
        place.listen()  # whoever comes before there is a server waits for it
    except OSError as error:
        raise BadInput(
            f"--host {host} --page-port {port}: nobody can listen there ({error.strerror}); choose another"
        ) from None
    return place


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m monitor", epilog=HELP, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--router", metavar="LOCATOR", help="of the fleet, such as tcp/127.0.0.1:7447")
    parser.add_argument("--fleet", metavar="NAME", help="the fleet's name")
    parser.add_argument("--access", type=Path, metavar="FILE", help="a running fleet's control.json: the right to ask")
    parser.add_argument("--replay", type=Path, metavar="RUN", help="a run's folder")
    parser.add_argument("--scenario", type=Path, metavar="FILE", help="of robots without a world, which are only heard")
    parser.add_argument("--radio", metavar="LOCATOR", help="where these robots hear each other (the router)")
    parser.add_argument("--host", default="127.0.0.1", metavar="HOST", help="address to serve on (127.0.0.1)")
    parser.add_argument("--port", type=int, default=0, metavar="N", help="TCP port to serve on (a free one)")
    parser.add_argument("--wait", type=float, default=60.0, metavar="S", help="how long to wait for the fleet (60)")
    parser.add_argument("--lifeline", type=int, metavar="FD", help="given by a launcher")
    parser.add_argument("--ready", type=int, metavar="FD", help="report the page's address on this pipe")
    return parser.parse_args(arguments)
