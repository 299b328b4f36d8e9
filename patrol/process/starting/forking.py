"""Many processes from one that has loaded what they need: a fork server, and what it is told.

A process spends most of its start on loading libraries and kernels. The server loads them once and then forks: a new
process begins where the server stands, and shares the server's memory as long as neither writes to it. Rules:

- The server runs one thread and opens no Zenoh session, because a fork copies only the thread that calls it, and the
  locks that others hold stay locked for ever.
- It learns nothing of the processes: what one of them is to be, and all that is its own, comes over a socket that the
  new process alone reads. So no memory that a process inherits ever held what belongs to another.
- It is not their parent. It forks twice, and the process in between ends at once, which leaves the new process to
  whoever takes in orphans (`adopting_orphans`): the one that asked for it. So that one alone signals it and learns how
  it ended, and the end of the server is nobody else's end.

Linux only: elsewhere nobody can be chosen to take in orphans, and libraries do not stand a fork.
"""

from __future__ import annotations

import ctypes
import json
import os
import socket
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

FORKED, FAILED = b"+", b"-"
"""What the server answers: the new process is there, or it could not be made."""

_ASK = b"?"
_PID_BYTES = 4
_CHUNK = 1 << 16
_MOST_BYTES = 1 << 20
"""Bytes of one process's orders: more than a command line may have."""
_PR_SET_CHILD_SUBREAPER, _PR_GET_CHILD_SUBREAPER = 36, 37


@dataclass(frozen=True, slots=True)
class Orders:
    """What a new process is to be.

    Attributes:
        command: Its command line, as it would be started by itself.
        environment: Variables beside those that the server has.
    """

    command: Sequence[str]
    environment: Mapping[str, str]


# --- the server ------------------------------------------------------------------------------------------------------


def threads() -> int:
    """How many threads this process has, those of libraries included."""
    return sum(1 for _ in Path("/proc/self/task").iterdir())


def serve_forks(descriptor: int) -> tuple[Orders, int] | None:
    """Fork whenever somebody asks for it; called in a process of one thread.

    Args:
        descriptor: Of the socket on which the requests arrive. The server ends when nobody holds the other end.

    Returns:
        In each new process, which leads a session of its own, its orders and the descriptor of its output; in the
        server None, when nobody can ask any more.
    """
    control = socket.socket(fileno=descriptor)
    while True:
        try:
            _, descriptors, _, _ = socket.recv_fds(control, len(_ASK), 1)
        except OSError:
            return None
        if not descriptors:
            return None
        with socket.socket(fileno=descriptors[0]) as desk:
            between = _fork()
            if between == 0:
                control.close()
                return _become(desk)
        made = between is not None and os.waitpid(between, 0)[1] == 0
        with suppress(OSError):  # who asked has gone, which the next request tells
            control.sendall(FORKED if made else FAILED)


def _fork() -> int | None:
    """As `os.fork`; None where there is no room for another process."""
    try:
        return os.fork()
    except OSError:
        return None


def _become(desk: socket.socket) -> tuple[Orders, int]:
    """Fork once more and end; in the new process, what it is told. Nothing returns to the server from here."""
    made = _fork()
    if made != 0:
        if made is not None:
            desk.sendall(made.to_bytes(_PID_BYTES, "little"))
        os._exit(0 if made is not None else 1)
    try:
        os.setsid()
        return _take_orders(desk)
    except (OSError, ValueError, LookupError, TypeError):  # who asked for this process has gone
        os._exit(1)


def _take_orders(desk: socket.socket) -> tuple[Orders, int]:
    message, descriptors, _, _ = socket.recv_fds(desk, _CHUNK, 1)
    while len(message) <= _MOST_BYTES and (more := desk.recv(_CHUNK)):
        message += more
    told = json.loads(message)
    return Orders(told["command"], told["environment"]), descriptors[0]


# --- who asks --------------------------------------------------------------------------------------------------------


def ask_for_fork(control: socket.socket, orders: Orders, output: int) -> int | None:
    """Have a server make a process, which becomes a child of this one.

    Args:
        control: Where the server listens; its timeout holds for each step.
        orders: What the new process is to be.
        output: Descriptor of the file that the process writes to.

    Returns:
        Its process id; None where the server cannot make it.

    Raises:
        OSError: The server has gone, or does not answer in time, or what it has made is no child of this process. A
            process that is not told what to be ends.
    """
    ours, theirs = socket.socketpair()
    with ours:
        with theirs:
            socket.send_fds(control, [_ASK], [theirs.fileno()])
        answer = control.recv(1)
        if answer != FORKED:
            if answer:
                return None
            raise ConnectionResetError
        ours.settimeout(control.gettimeout())
        pid = int.from_bytes(ours.recv(_PID_BYTES, socket.MSG_WAITALL), "little")
        os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT)  # raises where it is another's child
        told = {"command": [*orders.command], "environment": {**orders.environment}}
        message = json.dumps(told).encode()
        sent = socket.send_fds(ours, [message], [output])
        ours.sendall(message[sent:])
    return pid


def can_fork() -> bool:
    """Whether this system is one on which a fork server can work."""
    return sys.platform == "linux"


class _Adopters:
    """How many want this process to take in orphans: the setting is the whole process's, which may run several fleets.

    Attributes:
        count: How many.
    """

    def __init__(self) -> None:
        self.count = 0
        self._changing = threading.Lock()
        self._adopted_before = False

    def add(self) -> bool:
        """One more; whether the system does so."""
        with self._changing:
            before = adopts_orphans()
            if before is None or not adopt_orphans(True):
                return False
            if self.count == 0:
                self._adopted_before = before
            self.count += 1
            return True

    def remove(self) -> None:
        """One less; the last one leaves the setting as the first has found it."""
        with self._changing:
            self.count -= 1
            if self.count == 0 and not self._adopted_before:
                adopt_orphans(False)


adopters = _Adopters()


@contextmanager
def adopting_orphans() -> Iterator[bool]:
    """Meanwhile, this process becomes the parent of those of its descendants whose own parents end.

    Yields:
        Whether the system does so.
    """
    adopts = adopters.add()
    try:
        yield adopts
    finally:
        if adopts:
            adopters.remove()


def adopts_orphans() -> bool | None:
    """Whether this process takes in orphans; None where the system knows no such thing."""
    says = ctypes.c_int(0)
    with suppress(OSError, AttributeError):
        if ctypes.CDLL(None).prctl(_PR_GET_CHILD_SUBREAPER, ctypes.byref(says), 0, 0, 0) == 0:
            return bool(says.value)
    return None


def adopt_orphans(whether: bool) -> bool:
    """Have this process take in orphans from now on, or no more.

    Args:
        whether: Which.

    Returns:
        Whether the system did so.
    """
    return bool(ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, int(whether), 0, 0, 0) == 0)
