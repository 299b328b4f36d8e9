"""The child processes of one run: started, signalled, waited for and ended.

Each child runs in a session of its own, so that Ctrl-C reaches the launcher alone, and what a policy starts there can
be ended with it, unless that begins a session too. Each holds the reading end of a pipe, its lifeline, that ends when
the launcher does, however that ends (`runtime.process.lifeline`). `ForkServer` starts the fork server
and asks it for children, which are like any other; `runtime.starting.forking` is what the server does.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from patrol.errors import printable
from patrol.exchange import FIRST_INCARNATION
from runtime.starting.environment import own_environment, room_for
from runtime.starting.forking import Orders, ask_for_fork
from runtime.starting.readiness import StartPipe, StartReport

TRACEBACK = b"Traceback (most recent call last):"
LOG_LINES = 5
"""Lines of a child's log that are quoted when it has ended."""
TERM_S = 20.0
"""Time for a process to heed a signal before it is killed, which fails the verdict."""
FORK_SERVER = "the fork server"
"""A name that no robot can have."""
READY_S = 60.0
"""Longest wait of the launcher until it has loaded, on a machine with much else to do."""
ANSWER_S = 10.0
"""Longest time for a fork."""
OF_MINDS = MappingProxyType({"OPENBLAS_NUM_THREADS": "1"})
"""Environment of all built-in minds: OpenBLAS would have threads, and no mind does linear algebra."""
_POLL_S = 0.01


class Forked:
    """A child that another process has made; as `subprocess.Popen`, as far as the launcher uses it.

    Its `pid` stays its own until `poll` or `wait` has returned its exit code.
    """

    def __init__(self, pid: int) -> None:
        """Take over a child."""
        self.pid = pid
        self._code: int | None = None
        self._reaping = threading.Lock()

    def poll(self) -> int | None:
        """Return its exit code, negative for a signal, or None while it lives."""
        with self._reaping:
            if self._code is None:
                try:
                    pid, status = os.waitpid(self.pid, os.WNOHANG)
                except ChildProcessError:  # its exit code is lost, which counts as 0, as subprocess has it
                    pid, status = self.pid, 0
                if pid:
                    self._code = os.waitstatus_to_exitcode(status)
            return self._code

    def wait(self) -> int:
        """Wait until it has ended; return its exit code."""
        while (code := self.poll()) is None:
            with suppress(ChildProcessError):  # another thread has just looked
                os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOWAIT)
        return code

    def send_signal(self, sig: int) -> None:
        """Send a signal, unless it is known to have ended."""
        with self._reaping:
            if self._code is None:
                os.kill(self.pid, sig)

    def kill(self) -> None:
        """Send SIGKILL, unless it is known to have ended."""
        self.send_signal(signal.SIGKILL)


@dataclass(slots=True)
class Child:
    """A child process."""

    name: str  # a robot's, or one that no robot can have
    process: subprocess.Popen[bytes] | Forked
    log: Path  # of its output
    start: StartPipe | None = None  # reports that it has started; None for a child that reports nothing
    code: int | None = None  # exit code, negative for the signal that killed it; None while it lives
    incarnation: int = FIRST_INCARNATION  # how often its robot was started, this time included
    killed_by_fault: bool = False  # by one of the run's faults

    def poll(self) -> int | None:
        """Return its exit code, None while it lives; what foreign code has started in it ends with it."""
        if self.code is None and (code := self.process.poll()) is not None:
            self.code = code
            with suppress(OSError):  # there is nothing else in its group
                os.killpg(self.process.pid, signal.SIGKILL)
        return self.code

    def await_start(self, limit_s: float, stopped: Callable[[], bool] = lambda: False) -> StartReport | None:
        """Wait for its report, as `StartPipe.await_report` does; None where there is none.

        `limit_s` is wall time. `stopped` is asked all the time whether to wait no longer.
        """
        return None if self.start is None else self.start.await_report(limit_s, stopped)

    def log_tail(self) -> str:
        """Return the last lines of its log, indented, for people; what could disturb a terminal is escaped."""
        return "\n".join(f"    {line}" for line in self._last_lines(LOG_LINES))

    def last_words(self) -> str:
        """Return the last line of its log, without its name in front; empty when the log is."""
        lines = self._last_lines(1)
        return lines[0].strip().removeprefix(f"{self.name}: ") if lines else ""

    @property
    def has_traceback(self) -> bool:
        """True if its log holds a traceback."""
        try:
            return TRACEBACK in self.log.read_bytes()
        except OSError:
            return False

    def _last_lines(self, count: int) -> list[str]:
        try:
            lines = self.log.read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:
            lines = []
        return [printable(line.expandtabs()) for line in lines[-count:] if line.strip()]

    def describe_exit(self) -> str:
        """Say in words how it ended: by an exit code or a signal."""
        if self.code is not None and self.code < 0:
            return f"{self.name} was killed by {signal.Signals(-self.code).name}"
        return f"{self.name} ended with exit code {self.code}"

    def describe_end(self) -> str:
        """Say in words how it ended, with the end of its log."""
        tail = self.log_tail()
        return self.describe_exit() + (f"; the end of its log ({self.log}):\n{tail}" if tail else "")

    def close(self) -> None:
        """Close the pipe on which it reports its start."""
        if self.start is not None:
            self.start.close()


class Children:
    """The living and ended children of a run.

    `by_name` holds the latest child of each name, `former` earlier children of robots that were started again. `forks`
    makes children of its module; None where all are started by themselves.
    """

    def __init__(self, urgent: Callable[[], bool]) -> None:
        """Start no child yet; `urgent` is asked again and again whether to kill at once instead of waiting."""
        self.by_name: dict[str, Child] = {}
        self.former: list[Child] = []
        self.forks: ForkServer | None = None
        self._urgent = urgent
        self._lifeline: tuple[int, int] = (-1, -1)

    def spawn(
        self,
        name: str,
        module: str,
        arguments: Sequence[str],
        log: Path,
        *,
        inherit: Sequence[int] = (),
        reports_start: bool = False,
        environment: Mapping[str, str] = MappingProxyType({}),
    ) -> Child:
        """Start a child; it replaces an earlier one of the same name.

        ``--lifeline`` and ``--ready`` are added to the arguments, the latter if the child reports its start on a pipe.
        Its output is appended to `log`. It inherits the file descriptors `inherit`, and has the variables `environment`
        beside this process's own.

        A child that `forks` makes inherits the lifeline only, and reports nothing.
        """
        command = self.command(module, arguments)
        if self.forks is not None and module == self.forks.module:
            forked = self.forks.make(command, environment, log)
            if forked is not None:
                return self._take_in(Child(name, forked, log))
        descriptors = [self._lifeline[0], *inherit]
        start = StartPipe() if reports_start else None
        if start is not None:
            command += ["--ready", str(start.child_end)]
            descriptors.append(start.child_end)
        try:
            with log.open("ab") as output:
                process = subprocess.Popen(
                    command,
                    stdin=subprocess.DEVNULL,
                    stdout=output,
                    stderr=subprocess.STDOUT,
                    env={**own_environment(), **environment},
                    pass_fds=descriptors,
                    start_new_session=True,
                )
        except BaseException:
            if start is not None:
                start.close()
            raise
        if start is not None:
            start.spawned()
        return self._take_in(Child(name, process, log, start))

    def _take_in(self, child: Child) -> Child:
        if (earlier := self.by_name.get(child.name)) is not None:
            earlier.close()
        self.by_name[child.name] = child
        return child

    def command(self, module: str, arguments: Sequence[str]) -> list[str]:
        """Return the command line of a child, which tells it to heed the lifeline."""
        if self._lifeline[0] < 0:
            self._lifeline = os.pipe()
        return [sys.executable, "-P", "-m", module, *arguments, "--lifeline", str(self._lifeline[0])]

    def signal(self, names: Sequence[str], number: signal.Signals) -> None:
        """Send a signal to those of the children that live; unknown names are ignored."""
        for name in names:
            if name in self.by_name and self.by_name[name].poll() is None:
                self.by_name[name].process.send_signal(number)

    def wait(self, names: Sequence[str], limit_s: float) -> None:
        """Wait until children have ended, at most `limit_s` of wall time; not when it is urgent.

        Unknown names are ignored.
        """
        until = time.monotonic() + limit_s
        while time.monotonic() < until and not self._urgent():
            if all(self.by_name[name].poll() is not None for name in names if name in self.by_name):
                return
            time.sleep(_POLL_S)

    def end(self, names: Sequence[str]) -> None:
        """End children: SIGTERM, then SIGKILL for those that do not heed it. A stopped one continues first."""
        if not self._urgent():
            self.signal(names, signal.SIGTERM)
            self.signal(names, signal.SIGCONT)
            self.wait(names, TERM_S)
        self.signal(names, signal.SIGKILL)
        for name in names:
            self.by_name[name].process.wait()
            self.by_name[name].poll()

    def close(self) -> None:
        """Close all pipes; children that still live leave now, since their lifeline has ended."""
        for child in self.by_name.values():
            child.close()
        for end in self._lifeline:
            if end >= 0:
                os.close(end)
        self._lifeline = (-1, -1)


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
                server = FORK_SERVER, "agent.fork_server", arguments, log
                self._child = children.spawn(*server, inherit=[descriptor], reports_start=True, environment=OF_MINDS)
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
