"""The launcher's side of the clerk: started once a run has gone on for a while, and asked when it has ended.

If the clerk fails, the run goes on, and the launcher can do without it.
"""

from __future__ import annotations

import signal
import socket
import struct
import time
from collections.abc import Mapping
from multiprocessing.connection import Connection
from typing import TypeVar

from fogwatch.launch.children import Children
from fogwatch.launch.clerk_messages import REPORT, Judged, Progress, ReportAsked, ReportWritten, VerdictAsked
from fogwatch.run_folder.runfolder import RunFolder
from fogwatch.terminal.live_table import RunDisplay

CLERK = "the clerk"
"""A name that no robot can have."""
AFTER_S = 5.0
"""Age of a run when its clerk is started, s: a shorter one is judged before a process has started."""
SILENT_S = 20.0
"""A clerk that says nothing for this long is given up, s: one that works says so several times in a second."""
NICE = 5
"""Nice value added to the clerk's: it takes the processor time that the fleet leaves."""
_POLL_S = 0.1

Answer = TypeVar("Answer", Judged, ReportWritten)


class ClerkChild:
    """The clerk of one run, which may never be started, or die at any time."""

    def __init__(self, folder: RunFolder, display: RunDisplay, enabled: bool = True) -> None:
        """Start nothing yet; unless `enabled`, there will be no clerk at all."""
        self._folder = folder
        self._display = display
        self._children = Children(lambda: False)
        self._connection: Connection | None = None
        self._due: float | None = None
        self._started = not enabled

    def ticking(self) -> None:
        """Take note that the run goes on; start the clerk when it is time."""
        now = time.monotonic()
        if self._due is None:
            self._due = now + AFTER_S
        if not self._started and now >= self._due:
            self._started = True
            self._start()

    @property
    def loaded(self) -> bool:
        """True once the clerk has loaded what it needs, so that it can be asked."""
        clerk = self._children.by_name.get(CLERK)
        report = None if clerk is None or clerk.start is None else clerk.start.report()
        return self._connection is not None and report is not None and report.ready

    def begin_verdict(self, exit_codes: Mapping[str, int | None]) -> None:
        """Ask the clerk to judge the finished run; the codes are as for `worldsim.verdict.judge.judge`."""
        if not self.loaded:
            self._give_up()
        self._send(VerdictAsked(exit_codes))

    def judged(self) -> Judged | None:
        """Wait for the verdict; None without a working clerk."""
        return self._await(Judged)

    def begin_report(self) -> bool:
        """Ask the clerk, which has judged the run, to write the report meanwhile; False without a clerk."""
        self._send(ReportAsked(self._folder.report))
        return self._connection is not None

    def report_written(self) -> ReportWritten | None:
        """Wait until the report is written, and return how that went; None where the clerk is gone."""
        outcome = self._await(ReportWritten)
        self._display.progress(REPORT, 1.0)
        return outcome

    def close(self) -> None:
        """End the clerk; a file that it has not completed is gone then."""
        self._children.end(list(self._children.by_name))
        self._children.close()
        self._give_up()

    def _start(self) -> None:
        try:
            self._connection, theirs = open_pair()
            with theirs:
                arguments = ["--run", str(self._folder.path), "--talk", str(theirs.fileno()), "--nice", str(NICE)]
                log, inherit = self._folder.log("clerk"), [theirs.fileno()]
                self._children.spawn(CLERK, "fogwatch.clerk", arguments, log, inherit=inherit, reports_start=True)
        except OSError:  # the system has no room for one more process, file or descriptor
            self._give_up()

    def _send(self, message: VerdictAsked | ReportAsked) -> None:
        if self._connection is not None:
            try:
                self._connection.send(message)
            except OSError:
                self._give_up()

    def _await(self, kind: type[Answer]) -> Answer | None:
        """Wait for the clerk's next message of a kind, and show the progress that comes before."""
        until = time.monotonic() + SILENT_S
        while self._connection is not None:
            try:
                if not self._connection.poll(_POLL_S):
                    if time.monotonic() >= until:
                        self._give_up()
                    continue
                message = self._connection.recv()
            except Exception:  # noqa: BLE001 - unpickling a damaged message may raise anything
                self._give_up()
                continue
            until = time.monotonic() + SILENT_S
            if isinstance(message, kind):
                return message
            if isinstance(message, Progress):
                self._display.progress(message.step, message.share)
        return None

    def _give_up(self) -> None:
        """Do without the clerk: it ends at once, since the launcher may be about to write the same file."""
        self._children.signal([CLERK], signal.SIGKILL)
        if (clerk := self._children.by_name.get(CLERK)) is not None:
            clerk.process.wait()
        if self._connection is not None:
            self._connection.close()
            self._connection = None


def open_pair() -> tuple[Connection, socket.socket]:
    """Open the connection to a clerk; return the launcher's end and the clerk's.

    Reading at the launcher's end fails when the rest of a message does not come.
    """
    ours, theirs = socket.socketpair()
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("@ll", int(SILENT_S), 0))
    return Connection(ours.detach()), theirs
