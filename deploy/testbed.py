#!/usr/bin/env python3
"""A fleet of several machines on one: each robot is a host, a network namespace of its own.

    sudo .venv/bin/python deploy/testbed.py examples/direct-radio.yaml --out runs/bed --loss 0.3 --cut r2:20:10
    sudo .venv/bin/python deploy/testbed.py examples/direct-radio.yaml --by mesh --out runs/mesh --loss 0.3 --kill r2:60
    sudo .venv/bin/python deploy/testbed.py examples/three-hosts.yaml --by fleet --out runs/hosts --cut r2:90:60

Each robot has a wire to a hub, the host of router and world: a veth pair. With `--by fleet` it carries all
traffic. Otherwise a second wire is its radio: a pair of TAP devices between which this script carries Ethernet frames,
or loses them on their way to the robot, with a probability that you choose. Robots then hear each other by a multicast
group, one datagram a position, by a router over QUIC, or as a mesh: then there is no router at all, and robots
and world meet on the other wires as a mesh too. A cut takes all wires of a robot down for a while. Processes
have the folders of a fleet's members (`fogwatch fleet init`) and their certificates; each is started once, and never
again.

Needs Linux, root, iproute2, util-linux and /dev/net/tun, and fogwatch with its extra `sim`. Namespaces and processes
are gone when it ends; those of one that was killed are cleared up by the next. The run folder gets what any run leaves,
and network.json: what each radio wire has carried and lost, and when links were down.

Exit codes: 0 verdict valid (but for robots killed here), 1 invalid, or not all robots left of a mesh were seen to hear
each other within 2 s of a death, 2 bad input, 3 unknown, 4 not possible here, 130 interrupted.
"""

from __future__ import annotations

import argparse
import contextlib
import fcntl
import json
import math
import os
import re
import select
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from agent.ports import State
from fogwatch.fleets.folder import FleetFolder, make_fleet
from patrol.errors import BadInput
from patrol.journal import Journal, read_journal
from patrol.random import draw
from patrol.scenario import Scenario, load_scenario

INVALID, IMPOSSIBLE = 1, 4
BODY, RADIO = "10.77.0", "10.78.0"
"""The first three numbers of the addresses on bodies' and radios' wires; they exist inside the namespaces only."""
HUB = 254
GROUP, BODY_PORT, RADIO_PORT = "224.0.0.225", 7447, 7448
ROUTER = f"quic/{RADIO}.{HUB}:{RADIO_PORT}?mixed_rel=1"
"""Where a router that carries nothing but positions listens."""
MOST_ROBOTS = 100
GRACE_S = 3.0
DOWN, UP, KILLED = "down", "up", "killed"
HALF, PAGE = "half", "page"
SOON_S = 2.0
REPORTED_S = 0.3
"""By when robots have reported what they had heard before something happened, s."""
HEARD = Path(__file__).with_name("heard.py")
PATIENCE_S = 600.0
"""How long a process waits for the router and for the others, also where it is cut off from them."""

_TUN = Path("/dev/net/tun")
_TUNSETIFF, _IFF_TAP, _IFF_NO_PI = 0x400454CA, 0x0002, 0x1000
_LONGEST = 65536

Report = tuple[float, str, dict[str, int]]
"""When a robot's report came (Unix time, s), the robot, and how many frames it had heard of each other so far."""


class Impossible(Exception):
    """This machine or user cannot do that; one line says why."""


@dataclass
class Wire:
    """A radio's wire, between two TAP devices. The hub's end comes first. Counts are of frames towards the robot."""

    robot: int
    ends: tuple[int, int]
    passed: int = 0
    lost: int = 0

    def carry(self, end: int, loss: float, seed: int) -> None:
        """Carry one frame that has come out at an end to the other one, or lose it."""
        frame = os.read(end, _LONGEST)
        hub, robot = self.ends
        if end == robot:
            other = hub
        else:
            other = robot
            if draw(seed, self.robot, self.passed + self.lost) < loss:
                self.lost += 1
                return
            self.passed += 1
        with contextlib.suppress(OSError):  # that end is down
            os.write(other, frame)


class Relay:
    """Carries all radio wires' frames, on a thread of its own. loss: the share lost on the way to each robot."""

    def __init__(self, loss: float, seed: int) -> None:
        self.wires: list[Wire] = []
        self._loss = loss
        self._seed = seed
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> None:
        """Carry from now on."""
        self._thread.start()

    def stop(self) -> None:
        """Carry no more, and let the devices go."""
        self._over.set()
        if self._thread.ident is not None:
            self._thread.join()
        for wire in self.wires:
            for end in wire.ends:
                os.close(end)
        self.wires.clear()

    def _run(self) -> None:
        wire_of = {end: wire for wire in self.wires for end in wire.ends}
        while not self._over.is_set():
            for end in select.select(list(wire_of), [], [], 0.1)[0]:
                with contextlib.suppress(OSError):  # an end that is down
                    wire_of[end].carry(end, self._loss, self._seed)


@dataclass
class Bed:
    """Namespaces, wires and processes, and how they end. `clear` ends all processes, those too that others add."""

    scenario: Scenario
    out: Path
    relay: Relay
    radio_wires: bool
    mark: str = f"fogwatch-{os.getpid()}"
    names: dict[int, str] = field(default_factory=dict)
    processes: dict[str, subprocess.Popen[Any]] = field(default_factory=dict)

    @property
    def hub(self) -> str:
        """The namespace where router and world run."""
        return f"{self.mark}-hub"

    def space(self, robot: int) -> str:
        """A robot's namespace."""
        return f"{self.mark}-{robot}"

    def build(self) -> None:
        """Make all namespaces and wires."""
        self._namespace(self.hub)
        for bridge, network in (("body", BODY), ("radio", RADIO))[: 1 + self.radio_wires]:
            # A bridge that looks for listeners would lose groups until a querier is there, and there is none.
            ip("-n", self.hub, "link", "add", bridge, "type", "bridge", "mcast_snooping", "0")
            ip("-n", self.hub, "address", "add", f"{network}.{HUB}/24", "dev", bridge)
            ip("-n", self.hub, "link", "set", bridge, "up")
        for spec in self.scenario.roster:
            self.names[spec.number] = spec.name
            self._namespace(self.space(spec.number))
            self._wire_body(spec.number)
            if self.radio_wires:
                self._wire_radio(spec.number)
        self.relay.start()

    def clear(self) -> None:
        """End all processes, then take all namespaces away, and with them their devices."""
        for number in (signal.SIGTERM, signal.SIGKILL):
            for process in self.processes.values():
                if process.poll() is None:
                    process.send_signal(number)
            until = time.monotonic() + GRACE_S
            for process in self.processes.values():
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(max(until - time.monotonic(), 0.0))
        self.relay.stop()
        for space in namespaces(self.mark):
            ip("netns", "delete", space)

    def start(self, name: str, space: str, what: str | Path, *arguments: str) -> None:
        """Start a module or a script in a namespace. It dies with this one."""
        logs = self.out / "logs"
        logs.mkdir(parents=True, exist_ok=True)
        mortal = ["setpriv", "--pdeathsig", "KILL"]
        command = ["ip", "netns", "exec", space, *mortal, sys.executable, "-P"]
        command += [str(what) if isinstance(what, Path) else f"-m{what}", *arguments]
        with (logs / f"{name}.log").open("ab") as log:
            self.processes[name] = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log)

    def bring_about(self, event: Event) -> None:
        """Kill a process, take all wires of a robot down or up, or part the radios' network in two, or join it."""
        if event.what == KILLED:
            self.processes[event.who].kill()
        elif event.who == HALF:
            self.part(sorted(self.names)[len(self.names) // 2 :], "radio", apart=event.what == DOWN)
        else:
            number = {name: number for number, name in self.names.items()}[event.who]
            for kind in ("body", "radio")[: 1 + self.radio_wires]:
                ip("-n", self.hub, "link", "set", f"{kind}{number}", event.what)

    def part(self, robots: Sequence[int], kind: str, *, apart: bool) -> None:
        """Give the wires of some robots, of a kind, a hub of their own, or join them with the others again."""
        if apart:
            ip("-n", self.hub, "link", "add", "apart", "type", "bridge", "mcast_snooping", "0")
            ip("-n", self.hub, "link", "set", "apart", "up")
        for number in robots:
            ip("-n", self.hub, "link", "set", f"{kind}{number}", "master", "apart" if apart else kind)
        if not apart:
            ip("-n", self.hub, "link", "delete", "apart")

    def ticks(self) -> int:
        """The number of ticks that the world has done."""
        table = self.out / "ticks.csv"
        return max(table.read_bytes().count(b"\n") - 1, 0) if table.exists() else 0

    def _namespace(self, space: str) -> None:
        ip("netns", "add", space)
        silence = "for f in /proc/sys/net/ipv6/conf/*/disable_ipv6; do echo 1 > $f; done"
        subprocess.run(["ip", "netns", "exec", space, "sh", "-c", silence], check=False, capture_output=True)
        ip("-n", space, "link", "set", "lo", "up")

    def _wire_body(self, robot: int) -> None:
        here, there = f"body{robot}", "body"
        peer = ["peer", "name", there, "netns", self.space(robot)]
        ip("-n", self.hub, "link", "add", here, "type", "veth", *peer)
        self._connect(here, "body", robot, there, BODY)

    def _wire_radio(self, robot: int) -> None:
        ends: list[int] = []
        for space, device in ((self.hub, f"radio{robot}"), (self.space(robot), "radio")):
            temporary = f"fw{os.getpid()}-{len(ends)}"
            ends.append(_tap(temporary))
            ip("link", "set", temporary, "netns", space, "name", device)
        self.relay.wires.append(Wire(robot, (ends[0], ends[1])))
        self._connect(f"radio{robot}", "radio", robot, "radio", RADIO)

    def _connect(self, here: str, bridge: str, robot: int, there: str, network: str) -> None:
        ip("-n", self.hub, "link", "set", here, "master", bridge, "up")
        ip("-n", self.space(robot), "address", "add", f"{network}.{robot}/24", "dev", there)
        ip("-n", self.space(robot), "link", "set", there, "up")


@dataclass(frozen=True)
class Event:
    """An event at a simulated time, s: a link goes down or comes up again, or a process is killed."""

    at: float
    what: str
    who: str


def ip(*arguments: str) -> str:
    """Run iproute2's ip; what it prints. Raises Impossible when it refuses."""
    done = subprocess.run(["ip", *arguments], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise Impossible(f"ip {' '.join(arguments)}: {done.stderr.strip() or done.returncode}")
    return done.stdout


def namespaces(mark: str) -> list[str]:
    """The namespaces there are whose names begin with a mark and a dash."""
    return [words[0] for line in ip("netns", "list").splitlines() if (words := line.split())[0].startswith(f"{mark}-")]


def clear_up_after_others() -> None:
    """Take away namespaces of test beds that were killed before they could."""
    for space in namespaces("fogwatch"):
        owner = space.split("-")[1]
        if owner.isdigit() and not Path("/proc", owner).exists():
            ip("netns", "delete", space)


def check_rights() -> None:
    """Raise Impossible where this cannot work."""
    if sys.platform != "linux":
        raise Impossible("network namespaces are Linux's")
    if os.geteuid() != 0:
        raise Impossible("making network namespaces needs root")
    for program, package in (("ip", "iproute2"), ("setpriv", "util-linux")):
        if shutil.which(program) is None:
            raise Impossible(f"{package}'s {program} is not installed")
    trial = f"fogwatch-{os.getpid()}-trial"
    ip("netns", "add", trial)
    try:
        os.close(_tap(f"fw{os.getpid()}-t"))
        ip("netns", "exec", trial, "true")
    finally:
        ip("netns", "delete", trial)


@dataclass(frozen=True)
class Meeting:
    """The way in which a fleet's processes meet, and in which its robots hear each other."""

    by: str
    fleet: FleetFolder
    radio: FleetFolder | None
    """The mesh of the radios alone; None where they are no mesh."""

    def start_routers(self, bed: Bed) -> None:
        """Start the routers that it needs."""
        if self.by == "mesh":
            return
        guarded = ["--fleet", str(self.fleet.path)]
        bed.start("router", bed.hub, "fogwatch.router", *guarded)
        if self.by == "quic":
            bed.start("radio-router", bed.hub, "fogwatch.router", *guarded, "--listen", ROUTER)

    def options(self, member: str) -> list[str]:
        """The options by which a member's process meets the others."""
        own = ["--credentials", str(self.fleet.path / member)]
        if self.by == "fleet":
            return own
        by_itself = f"udp/{GROUP}:{RADIO_PORT}#iface=radio"
        radio = (ROUTER if self.by == "quic" else by_itself) if self.radio is None else str(self.radio.path / member)
        return [*own, "--radio", radio]


def make_meeting(by: str, folder: Path, names: Sequence[str]) -> Meeting:
    """Make the credentials that a fleet needs."""
    hosts = {name: number for number, name in enumerate(names, 1)} | {"world": HUB}

    def meshed(network: str) -> dict[str, str]:
        return {name: f"{network}.{number}" for name, number in hosts.items()} if by == "mesh" else {}

    routers = [] if by == "mesh" else [f"{BODY}.{HUB}", f"{RADIO}.{HUB}"]
    fleet = make_fleet(folder / "bed", "bed", names, routers, BODY_PORT, days=1, places=meshed(BODY))
    if by != "mesh":
        return Meeting(by, fleet, None)
    return Meeting(by, fleet, make_fleet(folder / "radio", "bed", names, [], RADIO_PORT, days=1, places=meshed(RADIO)))


def run(bed: Bed, meeting: Meeting, events: Sequence[Event], scenario: Path) -> int:
    """Run the fleet to its end; the world's exit code."""
    meeting.start_routers(bed)
    common = ["--scenario", str(scenario), "--wait", str(PATIENCE_S)]
    bed.start("world", bed.hub, "worldsim", *common, *meeting.options("world"), "--out", str(bed.out))
    for number, name in bed.names.items():
        bed.start(name, bed.space(number), "agent", *common, *meeting.options(name))
    viewer = str(meeting.fleet.path / "viewer")
    bed.start(PAGE, bed.hub, "monitor", "--credentials", viewer, "--wait", str(PATIENCE_S))
    if bed.radio_wires:
        bed.start("heard", bed.hub, HEARD, viewer, str(bed.out / "heard.jsonl"), *bed.names.values())
    world = bed.processes["world"]
    done = []
    for event in sorted(events, key=lambda event: event.at):
        while world.poll() is None and bed.ticks() * bed.scenario.step < event.at:
            time.sleep(0.02)
        bed.bring_about(event)
        done.append({"who": event.who, "what": event.what, "tick": bed.ticks(), "at_s": time.time()})
        said = f"{event.who} is killed" if event.what == KILLED else f"{event.who}'s link is {event.what}"
        print(f"tick {done[-1]['tick']}: {said}", flush=True)
    code = world.wait()
    wires = {bed.names[wire.robot]: {"passed": wire.passed, "lost": wire.lost} for wire in bed.relay.wires}
    network = {"by": meeting.by, "wires": wires, "events": done}
    (bed.out / "network.json").write_text(f"{json.dumps(network, indent=2)}\n", encoding="utf-8")
    return code


def report(out: Path, log: Path) -> Iterator[str]:
    """Give the results of a run, line by line."""
    if not (out / "summary.json").exists():
        yield f"there is no summary; the world said:\n{log.read_text(encoding='utf-8', errors='replace')}"
        return
    summary, network = (json.loads((out / f"{name}.json").read_text("utf-8")) for name in ("summary", "network"))
    for name, wire in network["wires"].items():
        total = wire["passed"] + wire["lost"]
        yield f"{name}: radio wire lost {wire['lost']} of {total} frames towards it ({_share(wire['lost'], total)})"
    for link, counts in summary.get("direct", {}).get("links", {}).items():
        yield f"{link}: heard {counts['heard']} of {counts['sent']} ({_share(counts['heard'], counts['sent'])})"
    down: dict[str, int] = {}
    for event in network["events"]:
        if event["what"] == KILLED or event["who"] == HALF:
            yield _after(out, network["wires"], network["events"], event)
        elif event["what"] == DOWN:
            down[event["who"]] = event["tick"]
        else:
            yield _course(read_journal(out / "journal"), event["who"], down[event["who"]], event["tick"])
    yield f"mean MFoW {summary['mfow_mean_s']:.1f} s; verdict {summary['verdict']['outcome']}; {out}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Build, run, report, clear; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario", type=Path, help="at the pace of a clock; without --by fleet with radio.via direct")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="run folder, new or empty")
    parser.add_argument(
        "--by",
        choices=("group", "quic", "mesh", "fleet"),
        default="group",
        help="multicast group, a router for positions over QUIC, no router at all, or the fleet's own router",
    )
    parser.add_argument("--loss", type=float, default=0.0, metavar="P", help="share lost on each radio's wire, 0 to 1")
    parser.add_argument("--seed", type=int, default=1, metavar="K", help="of what is lost (default: %(default)s)")
    parser.add_argument(
        "--cut",
        action="append",
        default=[],
        metavar="ROBOT:AT:FOR",
        help=f"take a robot's wires down, simulated s; {HALF} parts the radios' network in two",
    )
    parser.add_argument(
        "--kill",
        action="append",
        default=[],
        metavar="PROCESS:AT",
        help="kill a process at a simulated time, s: a robot's, router, radio-router or page",
    )
    options = parser.parse_args(arguments)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        scenario, events = _check(options)
        check_rights()
        clear_up_after_others()
        bed = Bed(scenario, options.out, Relay(options.loss, options.seed), radio_wires=options.by != "fleet")
        with tempfile.TemporaryDirectory(prefix="fogwatch-bed-") as secrets:
            meeting = make_meeting(options.by, Path(secrets), [spec.name for spec in scenario.roster])
            try:
                bed.build()
                code = run(bed, meeting, events, options.scenario)
            finally:
                bed.clear()
    except BadInput as bad:
        print(f"testbed: {bad}", file=sys.stderr)
        return 2
    except Impossible as impossible:
        print(f"testbed: not possible here: {impossible}", file=sys.stderr)
        return IMPOSSIBLE
    except KeyboardInterrupt:
        return 130
    for line in report(options.out, options.out / "logs" / "world.log"):
        print(line)
    if code == INVALID and as_asked(options.out, events):
        code = 0
    if options.by == "mesh" and not went_on(options.out):
        print(f"testbed: not all that were left heard each other within {SOON_S:g} s of each death", file=sys.stderr)
        return code or INVALID
    return code


def _check(options: argparse.Namespace) -> tuple[Scenario, list[Event]]:
    scenario = load_scenario(options.scenario)
    if options.by == "fleet":
        if scenario.pace == "lockstep":
            raise BadInput(f"{options.scenario}: pace = lockstep waits for a host that is cut off; set realtime")
        if options.loss:
            raise BadInput(f"--loss {options.loss:g}: only radio wires lose frames; leave out --by fleet")
    elif scenario.radio.via != "direct":
        raise BadInput(f"{options.scenario}: radio.via = {scenario.radio.via}: wires would carry nothing; set direct")
    if len(scenario.roster) > MOST_ROBOTS:
        raise BadInput(f"{options.scenario}: {len(scenario.roster)} robots; a test bed has at most {MOST_ROBOTS}")
    if scenario.spares:
        raise BadInput(f"{options.scenario}: has spare robots, and on a test bed nobody can join; leave them out")
    if not 0.0 <= options.loss <= 1.0:
        raise BadInput(f"--loss {options.loss:g}: expected a share from 0 to 1")
    if options.out.exists() and any(options.out.iterdir()):
        raise BadInput(f"--out {options.out}: not empty; choose another folder")
    robots = [spec.name for spec in scenario.roster]
    parts = [*robots, PAGE, *(() if options.by == "mesh" else ("router",))]
    parts += ["radio-router"] if options.by == "quic" else []
    halves = [HALF] if options.by != "fleet" else []
    events = [Event(at, KILLED, who) for who, at in _at("kill", "PROCESS:AT", "r2:20", options, parts)]
    for who, at, lasts in _at("cut", "ROBOT:AT:FOR", "r2:20:10", options, [*robots, *halves]):
        events += [Event(at, DOWN, who), Event(at + lasts, UP, who)]
    return scenario, events


def _at(
    option: str, form: str, example: str, options: argparse.Namespace, names: Sequence[str]
) -> Iterator[tuple[Any, ...]]:
    """Give the events of an option: to whom, and times."""
    for text in getattr(options, option):
        name, *words = text.split(":")
        try:
            times = [float(word) for word in words]
        except ValueError:
            times = []
        if len(times) != form.count(":"):
            raise BadInput(f"--{option} {text}: expected {form}, such as {example}")
        if name not in names:
            raise BadInput(f"--{option} {text}: {options.scenario} has no {name}; choose among {', '.join(names)}")
        yield name, *times


def _course(journal: Journal, name: str, down: int, up: int) -> str:
    """Say what the fog did before, during and after a cut, and when the robot that was cut off decided again."""
    step, place = journal.header.scenario["step"], [robot.name for robot in journal.header.robots].index(name)
    ticks = list(journal.ticks)
    spans = (("before", ticks[:down]), ("during", ticks[down:up]), ("after", ticks[up:]))
    mfow = ", ".join(f"{step * sum(t.mfow for t in span) / len(span):.1f} s {what}" for what, span in spans if span)
    rows = ((tick.k, tick.robots[place]) for tick in ticks[up:])
    back = next((k for k, row in rows if row.decision_ms is not None and row.state != State.HOLDING), None)
    again = "never decided again" if back is None else f"decided again {(back - up) * step:g} s after its link was back"
    return f"{name} {again}; mean MFoW {mfow} its cut"


def _waits(
    out: Path, robots: Iterable[str], events: Sequence[dict[str, Any]], event: dict[str, Any]
) -> list[tuple[float, str, str]]:
    """Give the times in s until those that are left heard each other after an event, and who heard whom.

    It is the time until the first report that shows it: at least `REPORTED_S`, and never too short.
    """
    dead = {one["who"] for one in events if one["what"] == KILLED and one["at_s"] <= event["at_s"]}
    left = [robot for robot in robots if robot not in dead]
    first_s = _first_heard(_reports(out), event["at_s"] + REPORTED_S)
    return [
        (first_s.get((hears, heard), math.inf) - event["at_s"], hears, heard)
        for hears in left
        for heard in left
        if hears != heard
    ]


def _after(out: Path, robots: Iterable[str], events: Sequence[dict[str, Any]], event: dict[str, Any]) -> str:
    """Say in a line what was heard after an event."""
    what = f"{event['who']} {event['what']}"
    if not robots or not (waits := _waits(out, robots, events, event)):
        return what
    if not _reports(out):
        return f"{what}: no robot's report of whom it hears has come; {out / 'logs' / 'heard.log'} may say why"
    longest_s, hears, heard = max(waits)
    within = sum(wait_s <= SOON_S for wait_s, _, _ in waits)
    last = "never" if longest_s == math.inf else f"after {longest_s:.1f} s"
    return (
        f"{what}: {within} of {len(waits)} pairs of those left heard each other within {SOON_S:g} s, the last, {hears} "
        f"{heard}, {last}"
    )


def went_on(out: Path) -> bool:
    """Return True if all that were left heard each other soon after each death. No report is no hearing."""
    network = json.loads((out / "network.json").read_text("utf-8"))
    robots, events = network["wires"], network["events"]
    deaths = [event for event in events if event["what"] == KILLED]
    return all(wait_s <= SOON_S for death in deaths for wait_s, _, _ in _waits(out, robots, events, death))


def as_asked(out: Path, events: Sequence[Event]) -> bool:
    """Return True if a verdict is invalid for nothing but the loss of robots whose processes were killed here."""
    if not (out / "summary.json").exists():  # the world has failed, which is no verdict
        return False
    checks = json.loads((out / "summary.json").read_text("utf-8"))["verdict"]["checks"]
    wrong = [check for check in checks if not check["ok"]]
    killed = {event.who for event in events if event.what == KILLED}
    lost = re.findall(r"(\S+) at tick", wrong[0]["detail"]) if wrong else []
    fine = [check["name"] for check in wrong] == ["nobody lost"] and bool(lost) and set(lost) <= killed
    if fine:
        print("the verdict is invalid because of the processes that were killed here, and of nothing else")
    return fine


def _reports(out: Path) -> list[Report]:
    """Read the reports that `heard.py` has written; none where it never met the fleet."""
    file = out / "heard.jsonl"
    return [json.loads(line) for line in file.read_text("utf-8").splitlines()] if file.exists() else []


def _first_heard(reports: Sequence[Report], since_s: float) -> dict[tuple[str, str], float]:
    """Give the time of the first report that shows it, by hearer and heard: a frame was heard since some time."""
    before: dict[str, dict[str, int]] = {}
    first_s: dict[tuple[str, str], float] = {}
    for at_s, robot, heard in reports:
        if at_s < since_s:
            before[robot] = heard
            continue
        for other, count in heard.items():
            if count > before.get(robot, {}).get(other, count):
                first_s.setdefault((robot, other), at_s)
    return first_s


def _share(part: int, whole: int) -> str:
    return f"{100.0 * part / whole:.1f} %" if whole else "none"


def _tap(name: str) -> int:
    """Make a TAP device; the descriptor that frames go in and come out by, on whose end the device ends."""
    try:
        device = os.open(_TUN, os.O_RDWR | os.O_CLOEXEC | os.O_NONBLOCK)
        fcntl.ioctl(device, _TUNSETIFF, struct.pack("16sH", name.encode(), _IFF_TAP | _IFF_NO_PI))
    except OSError as error:
        raise Impossible(f"{_TUN}: {error.strerror}") from None
    return device


if __name__ == "__main__":
    sys.exit(main())
