"""The launcher's side of the fork server: starts it, and asks it for agents.

A process that it has made is a child of the launcher like any other (`patrol.starting.forking`).
"""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType

from fogwatch.launch.children import Children, Forked
from patrol.starting.environment import room_for
from patrol.starting.forking import Orders, ask_for_fork

FORK_SERVER = "the fork server"
"""A name that no robot can have."""
READY_S = 60.0
"""Longest wait of the launcher until it has loaded, on a machine with much else to do."""
ANSWER_S = 10.0
"""Longest time for a fork."""
OF_MINDS = MappingProxyType({"OPENBLAS_NUM_THREADS": "1"})
"""Environment of all built-in minds: OpenBLAS would have threads, and no mind does linear algebra."""


class ForkServer:
    """Makes the agents of a run.

    Once it has failed, each is started by itself. `answer_s` is how long it may take to fork; None for ever.
    """

    module = "agent"

    def __init__(
        self, children: Children, log: Path, commands: Iterable[Sequence[str]], kernels: Sequence[str] = ()
    ) -> None:
        """Start it; it loads while the launcher does other things.

        OSError if it cannot be started. `commands` are about those that the agents will have; the longest counts.
        `kernels` are modules that it loads beside those that all agents need.
        """
        self.answer_s: float | None = ANSWER_S
        self._asking = threading.Lock()  # robots are started again on a thread of its own
        self._control, theirs = socket.socketpair()
        try:
            with theirs:
                descriptor = theirs.fileno()
                arguments = ["--control", str(descriptor), "--kernels", ",".join(kernels), "--room", room_for(commands)]
                server = "agent.fork_server", arguments, log
                self._child = children.spawn(
                    FORK_SERVER, *server, inherit=[descriptor], reports_start=True, environment=OF_MINDS
                )
        except BaseException:
            self._control.close()
            raise
        children.forks = self

    def await_start(self, stopped: Callable[[], bool]) -> None:
        """Wait until it can be asked; one that does not load in time is given up."""
        if self._child.await_start(READY_S, stopped) is None:
            self._child.process.kill()

    def make(self, command: Sequence[str], environment: Mapping[str, str], log: Path) -> Forked | None:
        """Make a child; None where there is no server that can make it.

        A server that stands still is given up, and ended: it must not do later what was asked of it. `environment`
        comes on top of the server's own; the child's output is appended to `log`.
        """
        with self._asking, suppress(OSError):
            report = None if self._child.start is None else self._child.start.report()
            if report is not None and report.ready and self._child.poll() is None:
                self._control.settimeout(self.answer_s)
                with log.open("ab") as output:
                    return Forked(ask_for_fork(self._control, Orders(command, environment), output.fileno()))
        self._child.process.kill()
        return None

    def close(self) -> None:
        """End it; its children go on. A request for a child meanwhile returns none."""
        self._child.process.kill()  # first: so no thread waits for its answer any more
        with self._asking:
            self._control.close()
