"""Measure what robots hear of each other over links that lose datagrams, and how late, by carrier: one table.

    sudo .venv/bin/python -m bench.links                             # half an hour
    sudo .venv/bin/python -m bench.links --ways "mesh;QUIC" --losses 0.3

Six hosts, each a network namespace of its own, are joined by wires that lose each datagram on its way to a host with a
given probability (`deploy/testbed.py`). On each a process sends ten positions of 20 bytes a second and hears the
others', by the same code as a robot. What was sent in half a minute counts, after another in which they meet.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import signal
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median, quantiles
from types import SimpleNamespace
from typing import Any, NoReturn, cast

from deploy.testbed import GROUP, HUB, IMPOSSIBLE, RADIO, RADIO_PORT, Bed, Impossible, Relay, check_rights, make_meeting
from fogwatch.fleets.folder import make_fleet
from patrol.scenario import Scenario
from runtime.net.mailbox import Mailbox
from runtime.net.open_links import open_air
from runtime.process.lifeline import leave
from runtime.security.credentials import read_credentials
from runtime.security.keys import fleet_keys, robot_of
from runtime.security.mesh import GUARDED

AT = f"{RADIO}.{HUB}:{RADIO_PORT}"
ROUTERS = {
    "TCP": f"tcp/{AT}",
    "TLS": f"tls/{AT}",
    "UDP, mixed reliability": f"udp/{AT}?rel=1;mixed_rel=1",
    "QUIC": f"quic/{AT}",
    "QUIC, mixed reliability": f"quic/{AT}?mixed_rel=1",
}
"""Where a router listens, by what carries positions through it."""
WAYS = ("multicast", *ROUTERS, "mesh")
LOSSES = (0.0, 0.1, 0.3, 0.6)
ROBOTS = tuple(f"r{number}" for number in range(1, 7))
FLEET = "links"
MEET_S, COUNT_S, END_S = 30.0, 30.0, 6.0
LOOK_S = 0.5
PERIOD_S = 0.1
_FRAME = struct.Struct("<dI8x")


@dataclass(frozen=True)
class Heard:
    """The frames that one host has heard.

    Attributes:
        first_s: When it first heard each of the others, s after all began.
        delays_s: Of the frames that were sent while it counted, by their sender; one that came twice counts once.
        sent: How many it has sent meanwhile.
    """

    first_s: dict[str, float]
    delays_s: dict[str, list[float]]
    sent: int


def main() -> int:
    """Measure, and print the table; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ways", default=";".join(WAYS), help="of carrying positions, with semicolons between them")
    default = ",".join(map(str, LOSSES))
    parser.add_argument(
        "--losses", type=_losses, default=default, help="shares of datagrams that are lost (%(default)s)"
    )
    parser.add_argument("--host", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.host is not None:
        _be_a_host(json.loads(options.host))
    ways = options.ways.split(";")
    if unknown := set(ways) - set(WAYS):
        parser.error(f"--ways: {min(unknown)}: choose among {'; '.join(WAYS)}")
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        check_rights()
        for line in _table(ways, options.losses):
            print(line, flush=True)
    except Impossible as impossible:
        print(f"links: not possible here: {impossible}", file=sys.stderr)
        return IMPOSSIBLE
    except KeyboardInterrupt:
        return 130
    return 0


def _losses(text: str) -> list[float]:
    """Read shares with commas between them."""
    try:
        losses = [float(word) for word in text.split(",")]
    except ValueError:
        losses = [math.nan]
    if not all(0.0 <= loss <= 1.0 for loss in losses):
        raise argparse.ArgumentTypeError(f"{text}: expected shares from 0 to 1, such as 0.1,0.3")
    return losses


def _table(ways: Sequence[str], losses: Sequence[float]) -> Iterator[str]:
    yield "| carried by | lost | heard | median ms | 95 % ms | largest ms | pairs that met in 30 s | the last s |"
    yield "|---|---|---|---|---|---|---|---|"
    for way in ways:
        for loss in losses:
            yield _row(way, loss, _measure(way, loss))


def _row(way: str, loss: float, hosts: dict[str, Heard]) -> str:
    pairs = len(hosts) * (len(hosts) - 1)
    delays = sorted(
        1e3 * delay for host in hosts.values() for link_delays in host.delays_s.values() for delay in link_delays
    )
    sent = sum(host.sent for host in hosts.values()) * (len(hosts) - 1)
    met = [first for host in hosts.values() for first in host.first_s.values() if first <= MEET_S]
    late = (
        f"{median(delays):.1f} | {quantiles(delays, n=20)[-1]:.0f} | {delays[-1]:.0f}"
        if len(delays) > 1
        else "- | - | -"
    )
    last = f"{max(met):.1f}" if met else "-"
    return f"| {way} | {loss:.0%} | {len(delays) / sent:.1%} | {late} | {len(met)} of {pairs} | {last} |"


def _measure(way: str, loss: float) -> dict[str, Heard]:
    """Let all hosts send and hear over links that lose so much."""
    roster = [SimpleNamespace(number=number, name=name) for number, name in enumerate(ROBOTS, 1)]
    with tempfile.TemporaryDirectory(prefix="fogwatch-links-") as temporary:
        folder = Path(temporary)
        bed = Bed(cast("Scenario", SimpleNamespace(roster=roster)), folder / "out", Relay(loss, 1), radio_wires=True)
        try:
            radios, credentials = _prepare(way, folder, bed)
            hosts = {
                name: start_host(
                    bed,
                    number,
                    "bench.links",
                    {"name": name, "radio": radios[name], "credentials": credentials.get(name)},
                )
                for number, name in bed.names.items()
            }
            _await_ready(hosts)
            begin(hosts)
            answers = _await_answers(hosts)
        finally:
            bed.clear()
    return {name: Heard(**json.loads(answer)) for name, answer in answers.items()}


def _await_ready(hosts: dict[str, subprocess.Popen[str]]) -> None:
    """Wait until all hosts wait for the word to begin. Raises Impossible when one ends instead."""
    for name, host in hosts.items():
        assert host.stdout is not None
        if not host.stdout.readline():
            raise Impossible(f"{name} does not start; what it printed is above")


def _await_answers(hosts: dict[str, subprocess.Popen[str]]) -> dict[str, str]:
    """Return what each host prints until it ends. Raises Impossible as soon as one of them fails."""
    answers: dict[str, str] = {}
    while waits_for := hosts.keys() - answers.keys():
        name = min(waits_for)
        with contextlib.suppress(subprocess.TimeoutExpired):
            answers[name] = hosts[name].communicate(timeout=LOOK_S)[0]
        for other, host in hosts.items():
            if host.poll():
                raise Impossible(f"{other} ended with exit code {host.returncode}; what it printed is above")
    return answers


def _prepare(way: str, folder: Path, bed: Bed) -> tuple[dict[str, str], dict[str, str]]:
    """Make the network, and a router where one is needed; each host's radio, and its credentials where it needs any."""
    bed.build()
    if way == "mesh":
        meeting = make_meeting("mesh", folder, ROBOTS)
        assert meeting.radio is not None
        own = {name: str(meeting.radio.path / name) for name in ROBOTS}
        return own, own
    if way == "multicast":
        return dict.fromkeys(ROBOTS, f"udp/{GROUP}:{RADIO_PORT}#iface=radio"), {}
    radio = ROUTERS[way]
    if not radio.startswith(GUARDED):
        bed.start("router", bed.hub, "fogwatch.router", "--listen", radio, "--open")
        await_router(bed, "router")
        return dict.fromkeys(ROBOTS, radio), {}
    fleet = make_fleet(folder / "fleet", FLEET, ROBOTS, [f"{RADIO}.{HUB}"], RADIO_PORT, 1)
    bed.start("router", bed.hub, "fogwatch.router", "--fleet", str(fleet.path), "--listen", radio)
    await_router(bed, "router")
    return dict.fromkeys(ROBOTS, radio), {name: str(fleet.path / name) for name in ROBOTS}


def await_router(bed: Bed, name: str) -> None:
    """Wait until a router listens. Raises Impossible when it ends instead."""
    log = bed.out / "logs" / f"{name}.log"
    while "router ready" not in log.read_text("utf-8"):
        if bed.processes[name].poll() is not None:
            raise Impossible(f"{name}: {log.read_text('utf-8')}")
        time.sleep(0.05)


def start_host(bed: Bed, number: int, module: str, what: dict[str, Any]) -> subprocess.Popen[str]:
    """Start a module as a host's process, which reads and writes lines. It ends with the bed or this process."""
    mortal = ["setpriv", "--pdeathsig", "KILL"]
    command = ["ip", "netns", "exec", bed.space(number), *mortal, sys.executable]
    command += ["-m", module, "--host", json.dumps(what)]
    host = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    bed.processes[bed.names[number]] = host
    return host


def begin(hosts: dict[str, subprocess.Popen[str]]) -> float:
    """Let all hosts, which wait for the word, begin at the same moment; return that moment, Unix time in s."""
    begin_s = time.time()
    for host in hosts.values():
        assert host.stdin is not None
        host.stdin.write(f"{begin_s}\n")
        host.stdin.flush()
    return begin_s


def exchange(
    what: dict[str, Any],
    robots: Sequence[str],
    begin_s: float,
    period_s: float,
    send_until_s: float = math.inf,
    end_s: float = math.inf,
) -> Iterator[tuple[str, float, int]]:
    """Send and hear on one host, by the code of a robot; yield sender, time and number of each frame, own ones too.

    Args:
        what: The host's name, its radio, and the folder of its credentials, if it has any.
        robots: The names of all.
        begin_s: When the first frame is due.
        period_s: Time between frames.
        send_until_s: When the last frame is due.
        end_s: When hearing ends.
    """
    credentials = None if what["credentials"] is None else read_credentials(Path(what["credentials"]), "host")
    keys = fleet_keys("bed" if credentials is None else credentials.fleet)
    own = what["name"]
    air = open_air(what["radio"], end_s - time.time(), lambda _waited: None, lambda: time.time() > end_s, credentials)
    mailbox: Mailbox[bytes] = Mailbox([keys.position(name) for name in robots if name != own], bytes, _FRAME.size, 4096)
    air.subscribe(keys.position("*"), mailbox)
    post = air.broadcast(keys.position(own))
    sent = 0
    while (now := time.time()) < end_s:
        if now >= begin_s + sent * period_s and now < send_until_s:
            post(_FRAME.pack(now, sent))
            yield own, now, sent
            sent += 1
        if (news := mailbox.get(max(min(begin_s + sent * period_s, end_s) - now, 0.001))) is not None:
            yield robot_of(news[0]), *_FRAME.unpack(news[1])
    air.close()


def _be_a_host(what: dict[str, Any]) -> NoReturn:
    """Send and hear on one host, and print what came of it."""
    print("ready", flush=True)
    begin_s = float(sys.stdin.readline())
    count_from, count_to = begin_s + MEET_S, begin_s + MEET_S + COUNT_S
    records = Heard({}, {name: [] for name in ROBOTS if name != what["name"]}, 0)
    seen: set[tuple[str, int]] = set()
    counted = 0
    for name, at_s, number in exchange(what, ROBOTS, begin_s, PERIOD_S, count_to, count_to + END_S):
        counts = count_from <= at_s < count_to
        if name == what["name"]:
            counted += counts
            continue
        records.first_s.setdefault(name, time.time() - begin_s)
        if counts and (name, number) not in seen:
            seen.add((name, number))
            records.delays_s[name].append(time.time() - at_s)
    print(json.dumps({"first_s": records.first_s, "delays_s": records.delays_s, "sent": counted}), flush=True)
    leave(0)


if __name__ == "__main__":
    sys.exit(main())
