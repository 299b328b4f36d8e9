"""Many processes from one that has loaded what they need: a fork server, and what it is told.

A process spends most of its start on loading libraries and kernels. The server loads them once and then forks: a new
process begins where the server stands, and shares the server's memory as long as neither writes to it. Rules:

- The server runs one thread and opens no Zenoh session, because a fork copies only the thread that calls it, and the
  locks that others hold stay locked for ever.
- It learns nothing of the processes: each is asked for with a socket of its own, from which the new process alone reads
  what it is to be. So no memory that a process inherits ever held what belongs to another.
- It is not their parent. It forks twice, and the process in between ends at once, which leaves the new process to the
  one that asked for it, since that takes in orphans meanwhile. So that one alone signals it and learns how it ended,
  and the end of the server ends no other process.

For one process, with the answer of 4 bytes of process id and one of `_MADE`:

    launcher -- control: the new process's socket --> server, which forks twice
    launcher <-- socket: id of the new process ------ the process in between, which ends
    launcher <-- socket: _MADE ---------------------- server
    launcher -- socket: Orders and the output ------> the new process

Linux only: elsewhere no process can take in orphans, and libraries do not stand a fork.
"""

from __future__ import annotations

import ctypes
import json
import os
import socket
import sys
import threading
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path

_ASK, _MADE = b"?", b"+"
_PID_BYTES = 4
_ANSWER_BYTES = _PID_BYTES + len(_MADE)
_CHUNK = 1 << 16
_PR_SET_CHILD_SUBREAPER, _PR_GET_CHILD_SUBREAPER = 36, 37
_adopting = threading.Lock()


@dataclass(frozen=True, slots=True)
class Orders:
    """The command line and environment of a new process."""

    command: Sequence[str]  # as the process would be started by itself
    environment: Mapping[str, str]  # variables beside those that the server has


def can_fork() -> bool:
    """Return whether this system is one on which a fork server can work."""
    return sys.platform == "linux"


def fork_process() -> int:
    """Fork this process, whatever threads its libraries have, for a copy that uses none of theirs.

    Returns the copy's process id, and 0 in the copy.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of Python 3.12 and later, where there are threads
        return os.fork()


def count_threads() -> int:
    """Count the threads of this process, those of libraries included."""
    return sum(1 for _ in Path("/proc/self/task").iterdir())


def serve_forks(descriptor: int) -> tuple[Orders, int] | None:
    """Fork for each request that arrives on a socket; called in a process of one thread.

    This returns in each new process, which leads a session of its own, with its orders and the descriptor of its
    output, or None where it gets no orders. In the server it returns None when no process holds the other end of the
    socket any more.
    """
    control = socket.socket(fileno=descriptor)
    while True:
        # Without a descriptor the other end is closed: each request brings one.
        _, descriptors, _, _ = socket.recv_fds(control, len(_ASK), 1)
        if not descriptors:
            return None
        with socket.socket(fileno=descriptors[0]) as channel:
            between = os.fork()
            if between == 0:
                # A process that kept it would make the server seem alive after its end.
                control.close()
                return _become_process(channel)
            if os.waitpid(between, 0)[1] == 0:
                with suppress(OSError):  # the asking process has gone, which the next request tells
                    channel.sendall(_MADE)


def _become_process(own: socket.socket) -> tuple[Orders, int] | None:
    """Fork once more and end; in the new process, return what it is told. Nothing returns to the server from here."""
    if (new_pid := os.fork()) != 0:
        try:
            own.sendall(new_pid.to_bytes(_PID_BYTES, "little"))
        finally:
            os._exit(0)
    # A session of its own: signals to the group of the server do not reach it.
    os.setsid()
    with suppress(OSError, ValueError):  # the asking process has gone, perhaps in the middle of the orders
        message, descriptors, _, _ = socket.recv_fds(own, _CHUNK, 1)
        while chunk := own.recv(_CHUNK):
            message += chunk
        return Orders(**json.loads(message)), descriptors[0]
    return None


def ask_for_fork(control: socket.socket, orders: Orders, output: int) -> int:
    """Have a server make a process, which becomes a child of this one, and return its process id.

    The timeout of `control` holds for each step. The process writes to the file of the descriptor `output`. An OSError
    says that the server has gone, does not answer in time, or has made no child of this process; a process that is not
    told what to be ends.
    """
    ours, theirs = socket.socketpair()
    with ours:
        ours.settimeout(control.gettimeout())
        with _adopting_orphans():
            with theirs:
                socket.send_fds(control, [_ASK], [theirs.fileno()])
            answer = b""
            while len(answer) < _ANSWER_BYTES:
                if not (chunk := ours.recv(_ANSWER_BYTES - len(answer))):
                    raise ConnectionResetError
                answer += chunk
        pid = int.from_bytes(answer[:_PID_BYTES], "little")
        os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT)  # raises where it is another's child
        message = json.dumps(asdict(orders)).encode()
        sent = socket.send_fds(ours, [message], [output])
        # The first call may send only a part, of orders with a large environment.
        ours.sendall(message[sent:])
    return pid


@contextmanager
def _adopting_orphans() -> Iterator[None]:
    """Become the parent of descendants whose own parents end meanwhile, where the system (Linux) knows such a thing.

    The setting is the whole process's, which may run several fleets: they ask one after the other.
    """
    prctl, before = ctypes.CDLL(None).prctl, ctypes.c_int(0)
    with _adopting:
        prctl(_PR_GET_CHILD_SUBREAPER, ctypes.byref(before), 0, 0, 0)
        prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
        try:
            yield
        finally:
            prctl(_PR_SET_CHILD_SUBREAPER, before.value, 0, 0, 0)
