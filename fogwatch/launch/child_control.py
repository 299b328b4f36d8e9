"""The launcher's side of process control: does what the world asks for, request by request, on a thread of its own.

The world's side, and the lines between the two, are in `worldsim.fleet.process_control`.
"""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Protocol

from worldsim.fleet.process_control import ENDED, Request, answer_line


class ProcessController(Protocol):
    """Starts, stops and ends robots' processes, as `fogwatch.launch.launcher.Launch` does.

    Robots are given by number.
    """

    def kill(self, robot: int) -> None:
        """Send SIGKILL and wait for the end."""
        ...

    def pause(self, robot: int) -> None:
        """Send SIGSTOP and wait until the process is stopped."""
        ...

    def state(self, robot: int) -> str:
        """A process's state by proc(5), empty where the system does not report it."""
        ...

    def has_ended(self, robot: int) -> bool:
        """Return whether a process has ended."""
        ...

    def resume(self, robot: int) -> None:
        """Send SIGCONT."""
        ...

    def await_exit(self, robot: int) -> None:
        """Wait for a process that has been asked to leave."""
        ...

    def restart(self, robot: int, incarnation: int) -> None:
        """Start a new process.

        Args:
            robot: Number of the robot.
            incarnation: How often the robot has been started, this time included.
        """
        ...


class ProcessControlServer:
    """Answers the world's requests, one at a time, until either end is closed."""

    def __init__(self, end: socket.socket, controller: ProcessController) -> None:
        """Start the thread that serves.

        Args:
            end: The launcher's end of the socket, which this closes.
            controller: What does the work.
        """
        self._end = end
        self._controller = controller
        self._actions: Mapping[str, Callable[[Request], None]] = {
            "kill": lambda request: controller.kill(request.robot),
            "pause": lambda request: controller.pause(request.robot),
            "resume": lambda request: controller.resume(request.robot),
            "leave": lambda request: controller.await_exit(request.robot),
            "start": lambda request: controller.restart(request.robot, request.incarnation),
        }
        self._thread = threading.Thread(target=self._serve, name="process-control", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Serve no more; a request in progress is finished first, without an answer."""
        with suppress(OSError):
            self._end.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._end.close()

    def _serve(self) -> None:
        with self._end.makefile("rb") as lines, suppress(OSError):
            for line in lines:
                self._end.sendall(self._perform(line))

    def _perform(self, line: bytes) -> bytes:
        """Do what a line asks for; the answer. The state of a process is read when its pause begins and ends."""
        try:
            request = Request.read(line)
            if request.do == "look":
                return answer_line(state=ENDED if self._controller.has_ended(request.robot) else "")
            before = self._controller.state(request.robot) if request.do == "resume" else ""
            self._actions[request.do](request)
            return answer_line(state=self._controller.state(request.robot) if request.do == "pause" else before)
        except Exception as error:  # noqa: BLE001 - the world reports whatever went wrong
            return answer_line(f"{type(error).__name__}: {error}")
