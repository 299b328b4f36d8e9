"""The cost of a delivery for a router: robots' positions, each to all others, as robots with a direct radio send them.

A router without access rules is joined by members that do nothing but send and hear. In each round every member sends
one frame, and the next round begins when all have heard all others: ticks without the robots.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Self

import psutil

from bench.runner import Bench
from fogwatch.launch.children import Children
from fogwatch.launch.launcher import free_port
from patrol.pose import Pose
from patrol.radio.message import Position, encode
from runtime.net.link import Link, open_link
from runtime.net.mailbox import Mailbox
from runtime.security.keys import fleet_keys

MEMBERS = (10, 20, 40)
BYTE_ROUNDS = 20
"""Rounds over which bytes are counted."""

ROUTER = "router"
FLEET = "load"
PATIENCE_S = 20.0


def main() -> None:
    """Measure the router's processor time, and the bytes on the loopback interface, for one delivery."""
    # The kernel counts a process's time in hundredths of a second.
    bench = Bench("router", processes=3, values=3, min_time_s=0.3)
    for members in MEMBERS:
        links = members * (members - 1)
        task = f"a delivery, {members} members"
        with Load(members) as load:
            bench.time(f"{task}: the router's processor time", load.router_time, inner_loops=links)
            bench.time(f"{task}: bytes both ways", load.bytes_sent, inner_loops=BYTE_ROUNDS * links, unit="byte")
    bench.end()


class Load:
    """A router and its members, which start when they are used first; a context manager around them."""

    def __init__(self, members: int) -> None:
        """Start nothing yet.

        Args:
            members: The number of those that send and hear, at least 2.
        """
        self._members = members
        self._open = ExitStack()
        self._heard = Heard()
        self._senders: list[Callable[[], None]] = []
        self._router: psutil.Process | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._open.close()

    def router_time(self, rounds: int) -> float:
        """Return the router's processor time for some rounds, s.

        Args:
            rounds: How many.
        """
        router = self._start()
        begun_s = _spent(router)
        self._do(rounds)
        return _spent(router) - begun_s

    def bytes_sent(self, loops: int) -> float:
        """Return the bytes that this machine has sent to itself, with headers, other processes included.

        Args:
            loops: How many times `BYTE_ROUNDS` rounds.
        """
        self._start()
        before = _loopback_bytes()
        self._do(loops * BYTE_ROUNDS)
        return float(_loopback_bytes() - before)

    def _do(self, rounds: int) -> None:
        for _ in range(rounds):
            for send in self._senders:
                send()
            self._heard.wait_for(self._members * (self._members - 1))

    def _start(self) -> psutil.Process:
        if self._router is not None:
            return self._router
        home = Path(self._open.enter_context(TemporaryDirectory(prefix="fogwatch-bench-")))
        children = Children(lambda: False)
        self._open.callback(children.close)
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        child = children.spawn(ROUTER, "fogwatch.router", ["--listen", endpoint], home / "log", reports_start=True)
        self._open.callback(children.end, [ROUTER])
        report = child.await_start(PATIENCE_S)
        if report is None or not report.ready:
            raise RuntimeError(f"the router did not start{'' if report is None else f': {report.detail}'}")
        self._router = psutil.Process(child.process.pid)
        for number in range(1, self._members + 1):
            self._join(endpoint, number)
        time.sleep(1.0 + 0.02 * self._members)  # a router tells its members of each other bit by bit
        self._do(1)
        return self._router

    def _join(self, endpoint: str, number: int) -> None:
        keys = fleet_keys(FLEET)
        link: Link = open_link(endpoint, PATIENCE_S)
        self._open.callback(link.close)
        for other in range(1, self._members + 1):
            if other != number:
                key = keys.position(f"r{other}")
                link.subscribe(key, Mailbox([key], self._heard.take, len(_frame(other)), room=1))
        post, frame = link.post(keys.position(f"r{number}")), _frame(number)
        self._senders.append(lambda: post(frame))


class Heard:
    """The count of what all members have heard, which Zenoh's threads add to."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._count = 0
        self._changed = threading.Condition()

    def take(self, _: bytes) -> None:
        """Count a frame."""
        with self._changed:
            self._count += 1
            self._changed.notify_all()

    def wait_for(self, count: int) -> None:
        """Wait for some frames, and begin anew.

        Args:
            count: The number of frames.

        Raises:
            RuntimeError: They have not all arrived in time.
        """
        with self._changed:
            if not self._changed.wait_for(lambda: self._count >= count, PATIENCE_S):
                raise RuntimeError(f"{count - self._count} of {count} messages have not arrived")
            self._count -= count


def _frame(number: int) -> bytes:
    return encode(Position.of(number, 1000, 500.0, Pose(123.45, 67.89, 1.0)))


def _spent(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)


def _loopback_bytes() -> int:
    return int(psutil.net_io_counters(pernic=True)["lo"].bytes_sent)


if __name__ == "__main__":
    main()
