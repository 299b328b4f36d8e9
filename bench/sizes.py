"""From which size on is a fleet better off with routers than as a mesh? Its cost, and cuts and deaths: two tables.

    sudo .venv/bin/python -m bench.sizes                                  # 11 minutes
    sudo .venv/bin/python -m bench.sizes --robots 12,24 --ways "mesh;one router"

The robots of a fleet at three sites, each robot a network namespace of its own, send five positions of 20 bytes a
second and hear the others', by the same code as an agent (`bench.links.exchange`). No datagram is lost. All start at
the same moment. When they have met, their cost is counted; then the network between the last site and the others is cut
and joined again; then a part that others may depend on is killed. Routers have network namespaces of their own too.
"""

from __future__ import annotations

import argparse
import json
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import IO, Any, NoReturn, cast

import psutil

from bench.links import await_router, begin, exchange, start_host
from deploy.testbed import BODY, BODY_PORT, IMPOSSIBLE, Bed, Impossible, Relay, check_rights, ip
from fogwatch.fleets.folder import FleetFolder, make_fleet
from patrol.scenario import Scenario

RING = "a ring of three routers"
WAYS = {"mesh": 0, "one router": 1, "three routers, linked to the first": 3, RING: 3}
"""The number of routers, by what carries positions. Where there is one at each site, a robot connects to that, and to
the others in turn where it is gone."""
SIZES = (6, 12, 24)
SITES = 3
FLEET = "sizes"
FIRST_ROUTER = 201
PERIOD_S = 0.2
SILENT_S = 1.0
"""A robot no longer hears another when nothing has come for so long, or nothing that young."""
START_S, MEET_S, COUNT_S, CUT_S, NOTICE_S, RETURN_S = 120.0, 60.0, 10.0, 20.0, 3.0, 40.0
NEIGHBOURS = Path("/proc/sys/net/ipv4/neigh/default/gc_thresh3")
"""The most addresses of neighbours that this machine keeps, for all network namespaces together."""
HEARS, MISSES, COUNTS = "+", "-", "="
COST = (
    "| robots | carried by | all have met, s | cores | of these routers | MB a robot | packets a robot and s "
    "| kB a robot and s | heard |"
)
CUTS = (
    "| robots | carried by | pairs within the parts that a cut leaves whole | all pairs again after it, s "
    "| then dies | pairs that go on | all again, s |"
)

Pair = tuple[str, str]


@dataclass
class Fleet:
    """A fleet that runs, and who hears whom in it.

    Attributes:
        bed: Its network.
        names: Of the robots.
        routers: Of its routers.
        hears: Since when each robot hears each other one, by hearer and heard, as s of the clock.
        missed: When a robot last noticed that it no longer hears another one.
        counts: How many positions each has heard, and when it said so.
    """

    bed: Bed
    names: list[str]
    routers: list[str]
    hosts: dict[str, subprocess.Popen[str]] = field(default_factory=dict)
    hears: dict[Pair, float] = field(default_factory=dict)
    missed: dict[Pair, float] = field(default_factory=dict)
    counts: dict[str, list[tuple[float, int]]] = field(default_factory=dict)
    ready: set[str] = field(default_factory=set)
    lines: queue.SimpleQueue[tuple[str, str]] = field(default_factory=queue.SimpleQueue)

    @property
    def sites(self) -> list[list[str]]:
        """The robots at each site."""
        per_site = len(self.names) // SITES
        return [self.names[site * per_site : (site + 1) * per_site] for site in range(SITES)]

    @property
    def numbers(self) -> dict[str, int]:
        """The numbers of robots and routers on the network, by name."""
        return {name: number for number, name in self.bed.names.items()}

    def start(self, name: str, what: dict[str, Any]) -> None:
        """Start a robot, which waits for the word to begin."""
        host = start_host(self.bed, self.numbers[name], "bench.sizes", what)
        self.hosts[name] = host
        assert host.stdout is not None
        threading.Thread(target=self._read, args=(name, host.stdout), daemon=True).start()

    def begin(self) -> float:
        """Let all robots begin at the same moment, when all are ready; that moment."""
        if not self.watch(lambda: len(self.ready) == len(self.names), START_S):
            raise Impossible(f"{len(self.names) - len(self.ready)} of the processes do not start")
        return begin(self.hosts)

    def watch(self, until: Callable[[], bool], limit_s: float) -> bool:
        """Take in what robots say until something is so, or time is up; whether it is."""
        end_s = time.time() + limit_s
        while not until() and (left_s := end_s - time.time()) > 0.0:
            try:
                name, line = self.lines.get(timeout=left_s)
            except queue.Empty:
                break
            self._take(name, *line.split())
        return until()

    def _read(self, name: str, lines: IO[str]) -> None:
        for line in lines:
            self.lines.put((name, line))

    def _take(self, name: str, at: str, sign: str, what: str = "") -> None:
        if sign == HEARS:
            self.hears[name, what] = float(at)
        elif sign == MISSES:
            self.missed[name, what] = float(at)
            self.hears.pop((name, what), None)
        else:
            self.ready.add(name)
            self.counts.setdefault(name, []).append((float(at), int(what)))

    def await_all(self, pairs: Collection[Pair], since_s: float, limit_s: float) -> str:
        """Wait until some pairs hear each other; how long that took, s, or that it took longer than the limit."""
        if not self.watch(lambda: self.hears.keys() >= set(pairs), limit_s):
            return f"{len(self.hears.keys() & set(pairs))} of {len(pairs)} after {limit_s:.0f}"
        return f"{max(0.0, max(self.hears[pair] for pair in pairs) - since_s):.1f}"

    def share_unbroken(self, pairs: Collection[Pair], since_s: float) -> str:
        """Which of some pairs have not ceased to hear each other since a time."""
        return f"{sum(self.missed.get(pair, 0.0) < since_s for pair in pairs)} of {len(pairs)}"

    def share_heard(self, since_s: float, until_s: float) -> float:
        """The share of the positions of others that robots have heard between two times."""
        shares = []
        for counts in self.counts.values():
            within = [count for count in counts if since_s <= count[0] <= until_s]
            (first_s, first), (last_s, last) = within[0], within[-1]
            shares.append((last - first) * PERIOD_S / (last_s - first_s) / (len(self.names) - 1))
        return sum(shares) / len(shares)


def main() -> int:
    """Measure, and print the tables; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ways", default=";".join(WAYS), help="of carrying positions, with semicolons between them")
    parser.add_argument("--robots", default=",".join(map(str, SIZES)), help="sizes of fleets, multiples of three")
    parser.add_argument("--host", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.host is not None:
        _be_a_host(json.loads(options.host))
    ways = options.ways.split(";")
    try:
        sizes = [int(size) for size in options.robots.split(",")]
    except ValueError:
        sizes = [0]
    if unknown := set(ways) - set(WAYS):
        parser.error(f"--ways: {min(unknown)}: choose among {'; '.join(WAYS)}")
    if any(size % SITES or not 0 < size < FIRST_ROUTER for size in sizes):
        parser.error(f"--robots {options.robots}: give multiples of {SITES} below {FIRST_ROUTER}")
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    costs, cuts = [], []
    try:
        check_rights()
        _check_neighbours(max(sizes))
        for size in sizes:
            for way in ways:
                cost, cut = _measure(way, size)
                costs.append(f"| {size} | {way} | {cost} |")
                cuts.append(f"| {size} | {way} | {cut} |")
                print(f"{costs[-1]}\n{cuts[-1]}", file=sys.stderr, flush=True)
    except Impossible as impossible:
        print(f"sizes: not possible here: {impossible}", file=sys.stderr)
        return IMPOSSIBLE
    except KeyboardInterrupt:
        return 130
    for head, rows in ((COST, costs), (CUTS, cuts)):
        print("\n".join([head, "|---" * head.count(" | ") + "|---|", *rows, ""]))
    return 0


def _check_neighbours(size: int) -> None:
    allowed, needed = int(NEIGHBOURS.read_text("ascii")), size * (size + SITES)
    if needed > allowed:
        raise Impossible(f"{size} robots have {needed} neighbours and {NEIGHBOURS} says {allowed}; write more there")


def _measure(way: str, size: int) -> tuple[str, str]:
    """Let a fleet meet, be cut in two, and lose a part; the rest of its rows in both tables."""
    names = [f"r{number}" for number in range(1, size + 1)]
    routers = [f"router{number}" for number in range(1, WAYS[way] + 1)]
    numbers = [*enumerate(names, 1), *enumerate(routers, FIRST_ROUTER)]
    roster = [SimpleNamespace(number=number, name=name) for number, name in numbers]
    with tempfile.TemporaryDirectory(prefix="fogwatch-sizes-") as temporary:
        folder = Path(temporary)
        bed = Bed(cast("Scenario", SimpleNamespace(roster=roster)), folder / "out", Relay(0.0, 1), radio_wires=False)
        fleet = Fleet(bed, names, routers)
        try:
            bed.build()
            _start(fleet, folder, is_ring=way == RING)
            return _cost(fleet), _cut_and_death(fleet)
        finally:
            bed.clear()


def _start(fleet: Fleet, folder: Path, *, is_ring: bool) -> None:
    """Start the routers, each of which connects to earlier ones, and the robots."""
    credentials = _credentials(fleet, folder)
    places = {name: f"quic/{BODY}.{fleet.numbers[name]}:{BODY_PORT}?mixed_rel=1" for name in fleet.routers}
    listed = list(places.values())
    for place, name in enumerate(fleet.routers):
        links = [word for other in listed[: place if is_ring else min(place, 1)] for word in ("--connect", other)]
        guarded = ["--fleet", str(credentials.path), "--listen", places[name]]
        fleet.bed.start(name, fleet.bed.space(fleet.numbers[name]), "fogwatch.router", *guarded, *links)
    for number, site in enumerate(fleet.sites):
        first = number if number < len(listed) else 0
        radio = ",".join([*listed[first:], *listed[:first]])
        for name in site:
            own = str(credentials.path / name)
            fleet.start(name, {"name": name, "robots": fleet.names, "radio": radio or own, "credentials": own})
    for name in fleet.routers:
        await_router(fleet.bed, name)


def _credentials(fleet: Fleet, folder: Path) -> FleetFolder:
    numbers = fleet.numbers
    hosts = [f"{BODY}.{numbers[name]}" for name in fleet.routers]
    places = {} if hosts else {name: f"{BODY}.{numbers[name]}" for name in fleet.names}
    return make_fleet(folder / "fleet", FLEET, fleet.names, hosts, BODY_PORT, 1, places)


def _cost(fleet: Fleet) -> str:
    """Let all meet, and count what it takes that they hear each other."""
    met = fleet.await_all(_pairs(fleet.names), fleet.begin(), MEET_S)
    robots = [psutil.Process(host.pid) for host in fleet.hosts.values()]
    routers = [psutil.Process(fleet.bed.processes[name].pid) for name in fleet.routers]
    begun_s, spent, traffic = time.time(), (_spent(robots), _spent(routers)), _traffic(fleet)
    fleet.watch(lambda: False, COUNT_S)
    ended_s = time.time()
    by_robots, by_routers = _spent(robots) - spent[0], _spent(routers) - spent[1]
    packets, size = (now - before for now, before in zip(_traffic(fleet), traffic, strict=True))
    for_s = ended_s - begun_s
    each_s = for_s * len(robots)
    memory = sum(robot.memory_info().rss for robot in robots) / len(robots)
    return (
        f"{met} | {(by_robots + by_routers) / for_s:.2f} | {by_routers / for_s:.2f} | {memory / 1e6:.0f} "
        f"| {packets / each_s:.0f} | {size / each_s / 1e3:.1f} | {fleet.share_heard(begun_s, ended_s):.1%}"
    )


def _cut_and_death(fleet: Fleet) -> str:
    """Cut the last site off, join it again, and kill a router, or a robot where there is none."""
    here, apart = [name for site in fleet.sites[:-1] for name in site], fleet.sites[-1]
    within = [*_pairs(here), *_pairs(apart)]
    numbers = [fleet.numbers[name] for name in [*apart, *fleet.routers[2:]]]
    cut_s = time.time()
    fleet.bed.part(numbers, "body", apart=True)
    fleet.watch(lambda: False, CUT_S)
    stay = fleet.share_unbroken(within, cut_s)
    fleet.bed.part(numbers, "body", apart=False)
    again = fleet.await_all(_pairs(fleet.names), time.time(), RETURN_S)
    killed_s = time.time()
    if fleet.routers:
        dies, left = "a router", fleet.names
        fleet.bed.processes[fleet.routers[0]].kill()
    else:
        dies, left = "a robot", fleet.names[1:]
        fleet.hosts[fleet.names[0]].kill()
    fleet.watch(lambda: False, NOTICE_S)
    back = "-" if len(fleet.routers) == 1 else fleet.await_all(_pairs(left), killed_s, RETURN_S)
    return f"{stay} | {again} | {dies} | {fleet.share_unbroken(_pairs(left), killed_s)} | {back}"


def _pairs(names: Sequence[str]) -> list[Pair]:
    return [(hears, sender) for hears in names for sender in names if hears != sender]


def _spent(processes: Sequence[psutil.Process]) -> float:
    """The processor time of some processes, s."""
    return float(sum(sum(process.cpu_times()[:2]) for process in processes))


def _traffic(fleet: Fleet) -> tuple[int, int]:
    """The packets and bytes on all robots' wires so far, both ways."""
    wires = {f"body{fleet.numbers[name]}" for name in fleet.names}
    counts = [
        link["stats64"][way]
        for link in json.loads(ip("-n", fleet.bed.hub, "-s", "-j", "link"))
        if link["ifname"] in wires
        for way in ("rx", "tx")
    ]
    return sum(count["packets"] for count in counts), sum(count["bytes"] for count in counts)


def _be_a_host(what: dict[str, Any]) -> NoReturn:
    """Be a robot; say whom it hears, whom no longer, and each second how many positions it has heard."""
    _say(COUNTS, 0)
    begin_s = float(sys.stdin.readline())
    last_s: dict[str, float] = {}
    count = 0
    for name, at_s, number in exchange(what, what["robots"], begin_s, PERIOD_S):
        now = time.time()
        if name != what["name"]:
            count += 1
            if now - at_s < SILENT_S:
                if name not in last_s:
                    _say(HEARS, name)
                last_s[name] = now
            continue
        for other in [other for other, other_s in last_s.items() if now - other_s > SILENT_S]:
            del last_s[other]
            _say(MISSES, other)
        if number % round(1.0 / PERIOD_S) == 0:
            _say(COUNTS, count)
    raise AssertionError("it hears until it is killed")


def _say(sign: str, what: object) -> None:
    print(time.time(), sign, what, flush=True)


if __name__ == "__main__":
    sys.exit(main())
