"""A child process's report that it is ready, or why it could not start: one JSON line on its own pipe.

The parent passes the writing end of a `StartPipe` to the child as a file descriptor (the option ``--ready FD``). The
child writes one line with `report_start`. A pipe that ends without a line belongs to a child that
ended or was killed before it could report; its exit code says the rest.
"""

from __future__ import annotations

import json
import os
import select
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from enum import StrEnum

_READ_BYTES = 4096
_REPORT_S = 0.05


class StartFailure(StrEnum):
    """Reasons for which a process could not start, as far as its parent acts on them."""

    PORT_BUSY = "port-busy"
    OTHER = "other"


@dataclass(frozen=True, slots=True)
class StartReport:
    """The one report of a child process, when it has started or given up."""

    address: str = ""  # where it listens; empty where it could not start
    failure: StartFailure | None = None  # None when it is ready
    detail: str = ""  # the error in one line; empty when it is ready

    @property
    def ready(self) -> bool:
        """True if the process can be used."""
        return self.failure is None


def report_start(descriptor: int | None, report: StartReport) -> None:
    """Report to the parent that this process is ready, or cannot start, and close the descriptor.

    The descriptor is the writing end of the parent's pipe, None where no parent waits.
    """
    if descriptor is None:
        return
    with suppress(OSError):  # the parent has died: the lifeline ends this process
        os.write(descriptor, json.dumps(asdict(report)).encode() + b"\n")
    with suppress(OSError):
        os.close(descriptor)


class StartPipe:
    """A parent's end of the pipe on which one child reports its start.

    `child_end` is the descriptor to pass to the child, -1 after `spawned`. Once the child has closed it, `ended` is
    True: what has not been reported by then never will be.
    """

    def __init__(self) -> None:
        self._end, self.child_end = os.pipe()
        self.ended = False
        self._bytes = b""
        self._report: StartReport | None = None

    def spawned(self) -> None:
        """Close this process's copy of the child's end, so that the pipe ends with the child."""
        if self.child_end >= 0:
            os.close(self.child_end)
            self.child_end = -1

    def report(self, timeout_s: float = 0.0) -> StartReport | None:
        """Return the child's report, None as long as there is none; wait for at most `timeout_s` of wall time."""
        if self._report is None and not self.ended and select.select([self._end], [], [], timeout_s)[0]:
            arrived = os.read(self._end, _READ_BYTES)
            self._bytes += arrived
            # A pipe that can be read and gives nothing is at its end.
            self.ended = not arrived
            line, newline, _ = self._bytes.partition(b"\n")
            if newline:
                self._report = _read_report(line)
        return self._report

    def await_report(self, limit_s: float, stopped: Callable[[], bool] = lambda: False) -> StartReport | None:
        """Wait for the child's report; return None where the child ends without one, or when the wait is over.

        The wait is over after `limit_s` of wall time, or when `stopped`, which is asked all the time, says so.
        """
        until = time.monotonic() + limit_s
        while (report := self.report(_REPORT_S)) is None:
            if self.ended or stopped() or time.monotonic() >= until:
                break
        return report

    def close(self) -> None:
        """Close what is open of the pipe."""
        self.spawned()
        if self._end >= 0:
            os.close(self._end)
            self._end = -1
        self.ended = True


def _read_report(line: bytes) -> StartReport:
    fields = json.loads(line)
    failure = fields["failure"]
    return StartReport(fields["address"], None if failure is None else StartFailure(failure), fields["detail"])
