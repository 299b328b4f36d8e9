"""``fogwatch replay`` and ``fogwatch monitor``: the page of a finished run, and of a running fleet.

Commands raise BadInput; the caller prints it.
"""

from __future__ import annotations

from argparse import Namespace
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from fogwatch.cli.command_help import command
from fogwatch.cli.ending import say
from fogwatch.cli.open_run import Key, open_folder, print_state
from fogwatch.cli.options import argument, option
from fogwatch.commands.fleet import WAIT_S, FleetOptions, RunningFleet, Wait
from patrol.errors import BadInput
from runtime.process.failures import INTERRUPTED

EXIT_CODES = "2 bad input, 130 ended by Ctrl-C"

_HOST = "Address to serve on; other than the loopback address it needs --token."
_PORT = "TCP port of the page (default: a free one)."
_TOKEN = "Secret that the page's address must hold; 16 or more letters and digits."


@dataclass(frozen=True)
class PageOptions:
    """The address of a page, and the token that lets visitors in."""

    host: Annotated[str, option("HOST", _HOST)] = "127.0.0.1"
    port: Annotated[int, option("N", _PORT, "--page-port", show_default=False)] = 0
    token: Annotated[str, option("TEXT", _TOKEN, envvar="FOGWATCH_PAGE_KEY", show_envvar=True)] = ""
    browser: Annotated[bool, option("", "Open the page in the default browser.", "--browser/--no-browser")] = False


@command(
    examples=[
        "fogwatch replay runs/yards-20260101-120000 --browser",
        "fogwatch replay runs/paper runs/ours",
        "fogwatch replay RUN --static patrol-page",
    ],
    exit_codes=f"0 written with --static, {EXIT_CODES}",
)
def replay(
    runs: Annotated[
        list[Path], argument("RUN [RUN]", "Folder of a run; of two, to see them side by side by one clock.")
    ],
    page: PageOptions,
    key: Key = None,
    static: Annotated[
        Path | None, option("DIR", "Serve nothing: write the page into this folder, to be opened without fogwatch.")
    ] = None,
) -> int:
    """Replay a run, or two, on a page in the browser, at any speed, forwards or backwards. Ctrl-C ends it."""
    if static is None:
        return _serve_page(Namespace(replay=runs, key=key), page)
    if page != PageOptions():
        raise BadInput(f"--static {static}: serves nothing; leave out --host, --page-port, --token and --browser")
    return _save_page(runs, static, key)


@command(
    examples=[
        "fogwatch monitor runs/yards-20260101-120000",
        "fogwatch monitor --credentials yards-1/viewer",
        "fogwatch monitor yards-1/operator",
        "fogwatch monitor yards-1/operator --scenario patrol.yaml",
    ],
    exit_codes=EXIT_CODES,
)
def monitor(
    run: RunningFleet = None, *, fleet: FleetOptions, page: PageOptions, wait: Wait = WAIT_S, key: Key = None
) -> int:
    """Show a running fleet on a live page, without slowing it. Ctrl-C ends the page, not the fleet.

    Given the folder of a run or an operator's credentials, the page can also pause the fleet and inject faults, or, for
    robots without a world, with their --scenario, stop and release them. Given --credentials of a viewer, or --router
    and --fleet, it only shows the fleet. A fleet may have any number of pages.
    """
    return _serve_page(fleet.as_source("monitor", run, wait, key), page)


def _save_page(folders: list[Path], out: Path, key: Path | None) -> int:
    """Write the page of a run, or of two, into a folder."""
    from monitor.replay.run_files import check_runs

    check_runs(folders)
    opened = [open_folder(folder, key) for folder in folders]
    from fogwatch.terminal.live_table import bar_on
    from monitor.page.saved import save_page

    with bar_on() as bar:
        frames = save_page([run for run, _ in opened], out, lambda ticks: bar.track(ticks, description="frames"))
    for run, going in opened:
        print_state(run, going)
    megabytes = sum(file.stat().st_size for file in out.rglob("*") if file.is_file()) / 1e6
    counts = " and ".join(map(str, frames))
    say(f"page: {out / 'index.html'}, {megabytes:.1f} MB, {counts} frames")
    return 0


def _serve_page(what: Namespace, page: PageOptions) -> int:
    from monitor.process import serve, source_opener
    from runtime.process.lifeline import heed

    def opened(address: str) -> None:
        if page.browser:
            import webbrowser

            webbrowser.open(address)

    ending = heed(None, patience=1)
    serve(source_opener(what, ending), page.host, page.port, page.token, ending, opened=opened)
    return INTERRUPTED
