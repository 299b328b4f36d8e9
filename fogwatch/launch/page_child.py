"""The process of a run's page: started, announced, and started again when it dies. The run goes on without it."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path

from fogwatch.launch.children import Child, Children
from monitor.process import KEY
from patrol.process.failures import INTERRUPTED

PAGE = "the page"
"""A name that no robot can have."""
MOST_RESTARTS = 3
"""Largest number of restarts of a page that has died."""


class PageChild:
    """A run's page. Its key is in no log and in no list of processes."""

    def __init__(self, children: Children, arguments: Sequence[str], log: Path, say: Callable[[str], None]) -> None:
        """Start no page yet."""
        self._children = children
        self._arguments = arguments
        self._log = log
        self._say = say
        self._key = os.urandom(16).hex()
        self._address = ""
        self._announced = False
        self._restarts = 0
        self._over = False

    def start(self) -> None:
        """Serve a page, if its libraries are installed."""
        missing = [name for name in ("starlette", "uvicorn", "websockets", "plotly") if find_spec(name) is None]
        if missing:
            self._over = True
            self._say(f"no page: {missing[0]} is not installed (pip install 'fogwatch[monitor]')")
            return
        self._spawn_page([])

    def check(self) -> None:
        """Show the address of a page that is ready; start one that has died again, at its address and with its key."""
        page = self._children.by_name.get(PAGE)
        if page is None or page.start is None or self._over:
            return
        has_ended = page.poll() is not None
        # One that has ended may have been ready: its address is the one to serve again.
        if not self._announced and (report := page.start.report()) is not None and report.address:
            self._announced = True
            if self._address != report.address:
                self._address = report.address
                self._say(f"page: {report.address}?key={self._key}")
        if has_ended:
            self._restart_page(page)

    def _restart_page(self, page: Child) -> None:
        if page.code == INTERRUPTED or self._restarts == MOST_RESTARTS:
            self._over = True
            self._say(page.describe_end())
            return
        self._restarts += 1
        self._say(f"{page.describe_exit()}; starting it again ({self._restarts} of {MOST_RESTARTS} times)")
        port = self._address.rpartition(":")[2].strip("/")
        self._spawn_page(["--page-port", port] if port and self._announced else [])

    def _spawn_page(self, extra: Sequence[str]) -> None:
        self._announced = False
        arguments, key = [*self._arguments, *extra], {KEY: self._key}
        self._children.spawn(PAGE, "monitor", arguments, self._log, reports_start=True, environment=key)
