"""The launcher's side of process control: does what the world asks for, request by request, on a thread of its own.

The world's side, and the lines between the two, are in `worldsim.fleet.process_control`.
"""

from __future__ import annotations

import os
import signal
import socket
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from fogwatch.launch.children import Child, Children
from worldsim.fleet.process_control import ENDED, Request, answer_line

GOODBYE_S = 30.0
"""Longest time until processes leave by themselves once the run is over; killed, they would fail the verdict."""


class ProcessControlServer:
    """Answers the world's requests, one at a time, until either end is closed."""

    def __init__(
        self, end: socket.socket, children: Children, robots: Sequence[str], restart: Callable[[int, int], None]
    ) -> None:
        """Start the thread that serves.

        `end` is the launcher's end of the socket; `close` closes it. `robots` are in the order of their numbers.
        `restart` starts a new process for a robot, by its number and how often it has been started, this time included.
        """
        self._end = end
        self._children = children
        self._robots = robots
        self._restart = restart
        self._thread = threading.Thread(target=self._serve_requests, name="process-control", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Serve no more; a request in progress is finished first, without an answer."""
        with suppress(OSError):
            self._end.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._end.close()

    def _serve_requests(self) -> None:
        with self._end.makefile("rb") as lines, suppress(OSError):
            for line in lines:
                try:
                    answer = answer_line(state=self._perform_request(Request.read(line)))
                except Exception as error:  # noqa: BLE001 - the world reports any failure
                    answer = answer_line(f"{type(error).__name__}: {error}")
                self._end.sendall(answer)

    def _perform_request(self, request: Request) -> str:
        """Do what is asked for; return the state of a process when its pause begins and ends, and whether it ended."""
        name = self._robots[request.robot - 1]
        if request.do == "start":
            self._restart(request.robot, request.incarnation)
            return ""
        child = self._children.by_name[name]
        match request.do:
            case "look":
                return ENDED if child.poll() is not None else ""
            case "pause":
                pause(child)
                return state_of(child)
            case "resume":
                before = state_of(child)
                child.process.send_signal(signal.SIGCONT)
                return before
            case "kill":
                child.killed_by_fault = True
                child.process.kill()
                child.process.wait()
                child.poll()
            case "leave":
                self._children.wait([name], GOODBYE_S)
                self._children.end([name])
            case unknown:
                raise KeyError(unknown)
        return ""


def pause(child: Child) -> None:
    """Send SIGSTOP and wait until the process is stopped."""
    child.process.send_signal(signal.SIGSTOP)
    with suppress(ChildProcessError):  # it has ended by itself
        os.waitid(os.P_PID, child.process.pid, os.WSTOPPED | os.WEXITED | os.WNOWAIT)


def state_of(child: Child) -> str:
    """Return the state of a process by proc(5), ``T`` where it is stopped; empty where there is no proc."""
    try:
        stat = Path(f"/proc/{child.process.pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return ""
    return stat.rpartition(")")[2].split()[0]
