"""``fogwatch replay`` and ``fogwatch monitor``: the page of a run that is over, and of a fleet that is running.

Commands raise BadInput; the caller prints it.
"""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Annotated

import typer

from patrol.errors import BadInput

HOST = typer.Option(metavar="HOST", help="Address to serve on; another than loopback needs --token.")
PORT = typer.Option("--page-port", metavar="N", help="TCP port of the page (default: a free one).")
TOKEN = typer.Option(
    metavar="TEXT",
    envvar="FOGWATCH_PAGE_KEY",
    help="What whoever opens the page must know; 16 letters or more.",
    show_envvar=True,
)
BROWSER = typer.Option("--browser/--no-browser", help="Open the page in a browser.")
INTERRUPTED = 130


def replay(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run's folder.")],
    host: Annotated[str, HOST] = "127.0.0.1",
    port: Annotated[int, PORT] = 0,
    token: Annotated[str, TOKEN] = "",
    browser: Annotated[bool, BROWSER] = False,
) -> int:
    """Play a run on the live page: at any speed, backwards too, with a time line. Ctrl-C ends it."""
    what = Namespace(replay=run, access=None, router=None, fleet=None, scenario=None, radio=None, wait=0.0)
    return _page(what, host, port, token, browser)


def monitor(
    run: Annotated[
        Path | None, typer.Argument(metavar="[RUN]", help="A running fleet's folder, or its control file.")
    ] = None,
    router: Annotated[str | None, typer.Option(metavar="LOCATOR", help="Or: its router, tcp/HOST:PORT,")] = None,
    fleet: Annotated[str | None, typer.Option(metavar="NAME", help="and its name. Such a page only looks.")] = None,
    scenario: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Of robots without a world: positions alone are heard.")
    ] = None,
    radio: Annotated[str | None, typer.Option(metavar="LOCATOR", help="Where such robots hear each other.")] = None,
    host: Annotated[str, HOST] = "127.0.0.1",
    port: Annotated[int, PORT] = 0,
    token: Annotated[str, TOKEN] = "",
    browser: Annotated[bool, BROWSER] = False,
    wait: Annotated[float, typer.Option(metavar="S", help="How long to wait for the fleet.")] = 60.0,
) -> int:
    """Show a running fleet on a live page, as many pages as wanted; none of them slows it. Ctrl-C ends it."""
    fleets = (router is not None) + (fleet is not None)
    if fleets != (2 if run is None else 0):
        raise BadInput("monitor: name a run's folder, or --router and --fleet of a running fleet")
    access = None if run is None else _access_in(run)
    if scenario is not None and router is None:
        raise BadInput("monitor: --scenario is for robots without a world; name their --router and --fleet as well")
    what = Namespace(replay=None, access=access, router=router, fleet=fleet, scenario=scenario, radio=radio, wait=wait)
    return _page(what, host, port, token, browser)


def _access_in(run: Path) -> Path:
    """The control file that a running fleet's folder holds, or that is named itself; BadInput where there is none."""
    from monitor.replay.run_files import JOURNAL
    from patrol.net.access import FILE

    if run.is_file() and run.name != JOURNAL:
        return run
    if not run.is_dir():
        raise BadInput(f"monitor {run}: no such folder; name a running fleet's, such as runs/yards-20260101-120000")
    if not (run / FILE).is_file():
        raise BadInput(
            f"monitor {run}: holds no {FILE}, so nothing is running there, or not yet; a run that is over is shown by: "
            f"fogwatch replay {run}"
        )
    return run / FILE


def _page(what: Namespace, host: str, port: int, token: str, browser: bool) -> int:
    from monitor.process import serve, source_opener
    from patrol.process.lifeline import heed

    def opened(address: str) -> None:
        if browser:
            import webbrowser

            webbrowser.open(address)

    ending = heed(None, patience=1)
    serve(source_opener(what, ending), host, port, token, ending, opened=opened)
    return INTERRUPTED
