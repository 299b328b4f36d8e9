"""The launcher's side of the fork server: starts it, asks it for agents, and does without it where it is of no use.

A process that it has made is a child of the launcher like any other (`patrol.process.starting.forking`).
"""

from __future__ import annotations

import os
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from types import MappingProxyType

from fogwatch.launch.children import Child, Children
from patrol.process.starting.command_line import room_for
from patrol.process.starting.forking import Orders, adopting_orphans, ask_for_fork, can_fork

FORK_SERVER = "the fork server"
"""A name that no robot can have."""
READY_S = 60.0
"""How long the launcher waits for it to load, on a machine with much else to do."""
ANSWER_S = 10.0
"""How long it may take to fork."""
OF_MINDS = MappingProxyType({"OPENBLAS_NUM_THREADS": "1"})
"""In the environment of all minds of ours: OpenBLAS would have threads, and no mind does linear algebra."""
_TICK_S = 0.05


class Forked:
    """A child that another process has made for this one; as `subprocess.Popen`, as far as the launcher uses it.

    Attributes:
        pid: Its process id, which stays its own until `poll` or `wait` has returned its exit code.
    """

    def __init__(self, pid: int) -> None:
        """Take over a child.

        Args:
            pid: Its process id.
        """
        self.pid = pid
        self._code: int | None = None
        self._reaping = threading.Lock()

    def poll(self) -> int | None:
        """Look whether it has ended; its exit code, negative for a signal, or None while it lives."""
        with self._reaping:
            if self._code is None:
                try:
                    ended, status = os.waitpid(self.pid, os.WNOHANG)
                except ChildProcessError:  # its exit code is lost, which counts as 0, as subprocess has it
                    ended, status = (self.pid if self._is_gone() else 0), 0
                if ended:
                    self._code = os.waitstatus_to_exitcode(status)
            return self._code

    def wait(self) -> int:
        """Wait until it has ended; its exit code."""
        while (code := self.poll()) is None:
            try:
                os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOWAIT)
            except ChildProcessError:  # another thread has just looked, or it is nobody's to wait for
                time.sleep(_TICK_S)
        return code

    def _is_gone(self) -> bool:
        """Whether a process that is no child any more has ended: the system keeps none where SIGCHLD is ignored."""
        if signal.getsignal(signal.SIGCHLD) == signal.SIG_IGN:
            return True
        try:
            os.kill(self.pid, 0)
        except ProcessLookupError:
            return True
        return False

    def send_signal(self, sig: int) -> None:
        """Send a signal, unless it is known to have ended."""
        with self._reaping:
            if self._code is None:
                os.kill(self.pid, sig)

    def kill(self) -> None:
        """Send SIGKILL, unless it is known to have ended."""
        self.send_signal(signal.SIGKILL)


class ForkServer:
    """Makes the agents of a run. Without one, or once it has failed, each is started by itself."""

    def __init__(
        self,
        children: Children,
        log: Path,
        stop: Callable[[], bool],
        commands: Iterable[Sequence[str]],
        kernels: Sequence[str] = (),
    ) -> None:
        """Start it, where the system is one for it; it loads while the launcher does other things.

        Args:
            children: The processes of the run.
            log: The file that the server's own output goes to.
            stop: Asked while the launcher waits for it.
            commands: The command lines that the agents will have, about; the longest counts.
            kernels: Kernel modules that it loads beside those that all agents need.

        Raises:
            OSError: It cannot be started.
        """
        self._children = children
        self._stop = stop
        self._control: socket.socket | None = None
        self._asking = threading.Lock()  # robots are started again on a thread of its own
        self._over = False
        self._adopting = ExitStack()
        if not can_fork() or not self._adopting.enter_context(adopting_orphans()):
            return
        self._control, theirs = socket.socketpair()
        self._control.settimeout(ANSWER_S)
        try:
            with theirs:
                self._spawn(theirs.fileno(), log, commands, kernels)
        except BaseException:
            self.close()
            raise

    def _spawn(self, control: int, log: Path, commands: Iterable[Sequence[str]], kernels: Sequence[str]) -> None:
        module = "agent.fork_server"
        arguments = ["--control", str(control), "--kernels", ",".join(kernels), "--room"]
        arguments.append(room_for(commands, self._children.command(module, [*arguments, ""])))
        self._children.spawn(
            FORK_SERVER, module, arguments, log, inherit=[control], reports_start=True, environment=OF_MINDS
        )

    def make(
        self, name: str, module: str, arguments: Sequence[str], log: Path, environment: Mapping[str, str]
    ) -> Child | None:
        """Make a child; it replaces an earlier one of the same name.

        Args:
            name: Its name in the run.
            module: The module that it runs.
            arguments: Its arguments; ``--lifeline`` is added.
            log: The file that its output is appended to.
            environment: Variables that its environment has beside the server's.

        Returns:
            The child; None where there is no server that can make it.
        """
        with self._asking:
            if self._control is None or not self._ready():
                return None
            command = self._children.command(module, arguments)
            try:
                with log.open("ab") as output:
                    pid = ask_for_fork(self._control, Orders(command, environment), output.fileno())
            except OSError:
                self._give_up()
                return None
            return None if pid is None else self._children.take_in(name, Forked(pid), log)

    def close(self) -> None:
        """Have it end; what it has made goes on. Whoever asks it for a child meanwhile gets none."""
        self._over = True
        if (control := self._control) is not None:
            with suppress(OSError):  # whoever asks has just given up
                control.shutdown(socket.SHUT_RDWR)
        with self._asking:
            self._hang_up()
            self._adopting.close()

    def _ready(self) -> bool:
        """Wait until it has loaded; False, and no longer of use, where that fails or takes too long."""
        pipe = self._children.by_name[FORK_SERVER].start
        until = time.monotonic() + READY_S
        while pipe is not None:
            if (report := pipe.report(_TICK_S)) is not None:
                if report.ready:
                    return True
                break
            if pipe.ended or self._over or self._stop() or time.monotonic() >= until:
                break
        self._give_up()
        return False

    def _give_up(self) -> None:
        """Use it no more, and end it: one that stands still must not do later what was asked of it."""
        self._children.by_name[FORK_SERVER].process.kill()
        self._hang_up()

    def _hang_up(self) -> None:
        if self._control is not None:
            self._control.close()
            self._control = None
