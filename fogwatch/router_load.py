"""How much one router carries: robots' positions, each to all others, as robots with a direct radio send them.

    python -m fogwatch.router_load --members 20 --seconds 5

Starts a router of its own, without access rules, and joins it as often as there are members. In each round every member
sends one frame, and the next round begins when all have heard all others: ticks without the robots. Prints one JSON
line.
"""

from __future__ import annotations

import argparse
import json
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from experiments.bench.tools.measure import Unmeasured
from experiments.bench.tools.procfs import family_of, loopback_bytes
from fogwatch.launch.children import Child, Children
from fogwatch.launch.free_port import free_port
from patrol.net.keys import fleet_keys
from patrol.net.link import Link, LinkDown, open_link
from patrol.net.mailbox import Mailbox
from patrol.pose import Pose
from patrol.radio.message import Position, encode

ROUTER = "router"
PATIENCE_S = 20.0
FLEET = "load"


@dataclass(frozen=True, slots=True)
class Load:
    """What a router carried.

    Attributes:
        members: Who sent and heard.
        rounds: Rounds in which all heard all others.
        seconds: Wall time of the rounds, s.
        router_s: The router's processor time for them, s.
        deliveries: Messages that it delivered.
        frame_bytes: Bytes of one message's payload.
        loopback_bytes: Bytes that this machine sent to itself meanwhile, in both directions, headers included.
    """

    members: int
    rounds: int
    seconds: float
    router_s: float
    deliveries: int
    frame_bytes: int
    loopback_bytes: int


class _Heard:
    """Counts what all members have heard, on Zenoh's threads."""

    def __init__(self) -> None:
        self._count = 0
        self._changed = threading.Condition()

    def take(self, _: bytes) -> None:
        with self._changed:
            self._count += 1
            self._changed.notify_all()

    def wait_for(self, count: int) -> None:
        with self._changed:
            if not self._changed.wait_for(lambda: self._count >= count, PATIENCE_S):
                raise Unmeasured(f"{count - self._count} of {count} messages have not arrived")


def carry(members: int, seconds: float) -> Load:
    """Have a router carry the positions of a fleet.

    Args:
        members: Who send and hear, at least 2.
        seconds: Wall time, s.

    Raises:
        Unmeasured: The router did not start, or messages did not arrive.
    """
    with ExitStack() as open_ones:
        home = Path(open_ones.enter_context(TemporaryDirectory(prefix="fogwatch-bench-")))
        children = Children(lambda: False)
        open_ones.callback(children.close)
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        router = children.spawn(ROUTER, "fogwatch.router", ["--listen", endpoint], home / "log", reports_start=True)
        open_ones.callback(children.end, [ROUTER])
        _await(router)
        heard = _Heard()
        senders = [_join(endpoint, number, members, heard, open_ones) for number in range(1, members + 1)]
        _begin(senders, heard, members)
        before, sent, begun = _used(router), loopback_bytes(), time.monotonic()
        rounds = 0
        each = members * (members - 1)
        while (spent := time.monotonic() - begun) < seconds:
            for send in senders:
                send()
            rounds += 1
            heard.wait_for((rounds + 1) * each)
        return Load(
            members=members,
            rounds=rounds,
            seconds=spent,
            router_s=_used(router) - before,
            deliveries=rounds * each,
            frame_bytes=len(_frame(1)),
            loopback_bytes=loopback_bytes() - sent,
        )


def _begin(senders: Sequence[Callable[[], None]], heard: _Heard, members: int) -> None:
    """The first round, when everybody knows of everybody: a router tells its members of each other bit by bit."""
    time.sleep(1.0 + 0.02 * members)
    for send in senders:
        send()
    heard.wait_for(members * (members - 1))


def _join(endpoint: str, number: int, members: int, heard: _Heard, open_ones: ExitStack) -> Callable[[], None]:
    keys = fleet_keys(FLEET)
    try:
        link: Link = open_link(endpoint, PATIENCE_S)
    except LinkDown as down:
        raise Unmeasured(str(down)) from None
    open_ones.callback(link.close)
    for other in range(1, members + 1):
        if other != number:
            key = keys.position(f"r{other}")
            link.subscribe(key, Mailbox([key], heard.take, len(_frame(other)), room=1))
    post, frame = link.post(keys.position(f"r{number}")), _frame(number)
    return lambda: post(frame)


def _frame(number: int) -> bytes:
    return encode(Position.of(number, 1000, 500.0, Pose(123.45, 67.89, 1.0)))


def _await(router: Child) -> None:
    report = router.await_start(PATIENCE_S)
    if report is None:
        raise Unmeasured("the router did not start in time")
    if not report.ready:
        raise Unmeasured(f"the router did not start: {report.detail}")


def _used(router: Child) -> float:
    """Processor time of the router so far, s."""
    return next(one.processor for one in family_of(router.process.pid) if one.pid == router.process.pid)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and print the result.

    Args:
        arguments: The command line; this process's own unless given.

    Returns:
        The exit code: 0 measured, 1 not.
    """
    parser = argparse.ArgumentParser(
        prog="python -m fogwatch.router_load", description="Measure what a router carries."
    )
    parser.add_argument("--members", type=int, default=20, metavar="N", help="who send and hear (default: 20)")
    parser.add_argument("--seconds", type=float, default=5.0, metavar="S", help="wall time (default: 5)")
    options = parser.parse_args(arguments)
    if options.members < 2 or not 0.0 < options.seconds < float("inf"):
        parser.error("at least 2 members and more than 0 seconds are needed")
    try:
        load = carry(options.members, options.seconds)
    except Unmeasured as why:
        print(why, file=sys.stderr)
        return 1
    print(json.dumps(asdict(load)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
