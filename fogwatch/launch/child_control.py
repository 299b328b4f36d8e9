"""The launcher's hands: what the world asks for is done here, on a thread of its own, request by request."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Protocol

from worldsim.fleet.process_control import Request, answer_line


class Doer(Protocol):
    """Who starts, stops and ends robots' processes: `fogwatch.launch.launcher.Launch`. Robots go by number."""

    def kill(self, robot: int) -> None:
        """SIGKILL, and waited for."""
        ...

    def pause(self, robot: int) -> None:
        """SIGSTOP, and waited for."""
        ...

    def state(self, robot: int) -> str:
        """A process's state as the system tells it, empty where nobody can tell."""
        ...

    def resume(self, robot: int) -> None:
        """SIGCONT."""
        ...

    def see_off(self, robot: int) -> None:
        """Wait for a process that has been told to go."""
        ...

    def start_anew(self, robot: int, incarnation: int) -> None:
        """A new process."""
        ...


class HandsServer:
    """Answers the world's requests, one at a time, until either end is closed."""

    def __init__(self, end: socket.socket, doer: Doer) -> None:
        self._end = end
        self._doer = doer
        self._does: Mapping[str, Callable[[Request], None]] = {
            "kill": lambda request: doer.kill(request.robot),
            "pause": lambda request: doer.pause(request.robot),
            "resume": lambda request: doer.resume(request.robot),
            "leave": lambda request: doer.see_off(request.robot),
            "start": lambda request: doer.start_anew(request.robot, request.incarnation),
        }
        self._thread = threading.Thread(target=self._serve, name="hands", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Do nothing more; a request that is being done is finished first, unanswered."""
        with suppress(OSError):
            self._end.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._end.close()

    def _serve(self) -> None:
        with self._end.makefile("rb") as lines, suppress(OSError):
            for line in lines:
                self._end.sendall(self._do(line))

    def _do(self, line: bytes) -> bytes:
        """Do what a line asks for; the answer. A pause is looked at when it begins and ends."""
        try:
            request = Request.read(line)
            before = self._doer.state(request.robot) if request.do == "resume" else ""
            self._does[request.do](request)
            return answer_line(state=self._doer.state(request.robot) if request.do == "pause" else before)
        except Exception as error:  # noqa: BLE001 - whatever went wrong is the world's to tell
            return answer_line(f"{type(error).__name__}: {error}")
