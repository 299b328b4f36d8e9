"""``fogwatch replay`` and ``fogwatch monitor``: the page of a finished run, and of a running fleet.

Commands raise BadInput; the caller prints it.
"""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Annotated

import typer

from fogwatch.commands.fleet import (
    WAIT_S,
    CredentialsOption,
    Fleet,
    FleetScenario,
    Radio,
    Router,
    Wait,
    check_one_fleet,
    fleet_access,
)
from fogwatch.commands.open_run import KEY, open_folder, print_state
from patrol.errors import BadInput
from patrol.printable import printable
from patrol.process.exit_codes import INTERRUPTED

REPLAY_EXAMPLES = [
    "fogwatch replay runs/yards-20260101-120000 --browser",
    "fogwatch replay runs/paper runs/ours",
    "fogwatch replay RUN --static patrol-page",
]
MONITOR_EXAMPLES = [
    "fogwatch monitor runs/yards-20260101-120000",
    "fogwatch monitor --credentials yards-1/viewer",
    "fogwatch monitor yards-1/operator",
    "fogwatch monitor yards-1/operator --scenario patrol.yaml",
]

EXIT_CODES = "2 bad input, 130 ended by Ctrl-C"
REPLAY_EXIT_CODES = f"0 written with --static, {EXIT_CODES}"

HOST = typer.Option(metavar="HOST", help="Address to serve on; other than the loopback address it needs --token.")
PORT = typer.Option("--page-port", metavar="N", help="TCP port of the page (default: a free one).", show_default=False)
TOKEN = typer.Option(
    metavar="TEXT",
    envvar="FOGWATCH_PAGE_KEY",
    help="Secret that the page's address must hold; 16 or more letters and digits.",
    show_envvar=True,
)
BROWSER = typer.Option("--browser/--no-browser", help="Open the page in the default browser.")


def replay(
    runs: Annotated[
        list[Path],
        typer.Argument(metavar="RUN [RUN]", help="Folder of a run; of two, to see them side by side by one clock."),
    ],
    host: Annotated[str, HOST] = "127.0.0.1",
    port: Annotated[int, PORT] = 0,
    token: Annotated[str, TOKEN] = "",
    browser: Annotated[bool, BROWSER] = False,
    key: Annotated[Path | None, KEY] = None,
    static: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Serve nothing: write the page into this folder, to be opened without fogwatch."
        ),
    ] = None,
) -> int:
    """Replay a run, or two, on a page in the browser, at any speed, forwards or backwards. Ctrl-C ends it."""
    if static is not None:
        if host != "127.0.0.1" or port or token or browser:
            raise BadInput(f"--static {static}: serves nothing; leave out --host, --page-port, --token and --browser")
        return _save(runs, static, key)
    arguments = Namespace(
        replay=runs,
        key=key,
        access=None,
        credentials=None,
        router=None,
        fleet=None,
        scenario=None,
        radio=None,
        wait=0.0,
    )
    return _page(arguments, host, port, token, browser)


def monitor(
    run: Annotated[
        Path | None,
        typer.Argument(metavar="[RUN]", help="Folder of a running fleet, or an operator's credentials."),
    ] = None,
    credentials: CredentialsOption = None,
    router: Router = None,
    fleet: Fleet = None,
    scenario: FleetScenario = None,
    radio: Radio = None,
    host: Annotated[str, HOST] = "127.0.0.1",
    port: Annotated[int, PORT] = 0,
    token: Annotated[str, TOKEN] = "",
    browser: Annotated[bool, BROWSER] = False,
    wait: Wait = WAIT_S,
    key: Annotated[Path | None, KEY] = None,
) -> int:
    """Show a running fleet on a live page, without slowing it. Ctrl-C ends the page, not the fleet.

    Given the folder of a run or an operator's credentials, the page can also pause the fleet and inject faults, or, for
    robots without a world, with their --scenario, stop and release them. Given --credentials of a viewer, or --router
    and --fleet, it only shows the fleet. A fleet may have any number of pages.
    """
    check_one_fleet("monitor", run, credentials, router, fleet)
    access = fleet_access("monitor", run, scenario)
    arguments = Namespace(
        replay=None,
        key=key,
        access=access,
        credentials=credentials,
        router=router,
        fleet=fleet,
        scenario=scenario,
        radio=radio,
        wait=wait,
    )
    return _page(arguments, host, port, token, browser)


def _save(folders: list[Path], out: Path, key: Path | None) -> int:
    """Write the page of a run, or of two, into a folder."""
    from monitor.replay.run_files import check_runs

    check_runs(folders)
    opened = [open_folder(folder, key) for folder in folders]
    from rich.console import Console
    from rich.progress import TimeRemainingColumn

    from fogwatch.terminal.bars import bar_on
    from monitor.page.saved import save_page

    with bar_on(Console(stderr=True), TimeRemainingColumn()) as bar:
        frames = save_page([run for run, _ in opened], out, lambda ticks: bar.track(ticks, description="frames"))
    for run, going in opened:
        print_state(run, going)
    megabytes = sum(file.stat().st_size for file in out.rglob("*") if file.is_file()) / 1e6
    counts = " and ".join(map(str, frames))
    typer.echo(printable(f"page: {out / 'index.html'}, {megabytes:.1f} MB, {counts} frames"))
    return 0


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
