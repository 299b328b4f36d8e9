"""The process around the world: it gathers the robots, runs the ticks, and writes down what happens as it happens."""

from __future__ import annotations

import argparse
import json
import os
import shutil
import socket
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from patrol.errors import BadInput
from patrol.process.lifeline import INTERRUPTED as EXIT_INTERRUPTED
from patrol.process.lifeline import Ending, heed
from patrol.process.options import TOGETHER, fleet_parser, prepared_as_told

if TYPE_CHECKING:
    from patrol.journal import Event, Header, JournalWriter, TickRecord
    from patrol.net.keys import FleetKeys
    from patrol.net.link import Air, Link, Question
    from patrol.prepare import Prepared
    from patrol.scenario import Scenario
    from worldsim.fleet.lockstep import LockstepFleet
    from worldsim.fleet.paced import PacedFleet
    from worldsim.fleet.sessions import Seats
    from worldsim.operator import Manner, Operator
    from worldsim.output.feed_publisher import Feed
    from worldsim.output.record import Recorder
    from worldsim.output.ticks_table import TicksTable
    from worldsim.radio.listener import Ear
    from worldsim.world import World

HELP = f"""
The world of a fleet whose router and robots run elsewhere. {TOGETHER}

The run begins when all robots of the scenario are there. The folder gets the journal and ticks.csv; started by hand,
also summary.json and scenario.yaml with a copy of its map: all that `fogwatch report`, `replay` and `record` ask for.
Exit codes: 0 verdict valid, 1 invalid, 2 bad input, 3 unknown (it could not be judged), 130 interrupted.
"""

UNKNOWN = 3
HANDS_GONE_S = 2.0
"""How long after the launcher has stopped answering the reason for it may take to come."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one world; the exit code."""
    options = _options(arguments)
    ending = heed(options.lifeline)
    try:
        return _run(options, ending)
    except BadInput as bad:
        print(f"world: {bad}", file=sys.stderr)
        return 2
    finally:
        if options.lifeline is not None and options.static is not None and ending:
            for static in (options.static, options.static.with_suffix(".part")):  # its launcher may be gone
                shutil.rmtree(static, ignore_errors=True)


def _run(options: argparse.Namespace, ending: Ending) -> int:
    from patrol.net.access import read_access
    from patrol.net.keys import check_locator, check_radio, fleet_keys
    from patrol.process.warmup import warm
    from patrol.scenario import load_scenario
    from worldsim.output.folder import check

    options.token = None if options.control is None else read_access(options.control, "--control").token
    router = check_locator(options.router, "--router")
    keys = fleet_keys(options.fleet)
    scenario = load_scenario(options.scenario)
    _check_hands(scenario, options.hands)
    radio = check_radio(options.radio, "--radio", scenario.radio.via)
    check(options.scenario, options.out)
    warm(("patrol", "worldsim"), _say)

    from patrol.net.link import open_links
    from worldsim.fleet.sessions import Interrupted, Missing

    prepared = prepared_as_told(scenario, options, ending)
    if prepared is None:
        return EXIT_INTERRUPTED

    links = open_links(router, radio, options.wait, _say, lambda: bool(ending))
    if links is None:
        return EXIT_INTERRUPTED
    link, air = links
    try:
        ear = _ear(link, air, keys, scenario) if scenario.radio.via == "direct" else None
        seats = _gather(link, keys, scenario, options.wait, ending)
        wall_s = _record(options, prepared, link, keys, seats, ear, ending)
    except Interrupted:
        return EXIT_INTERRUPTED
    except Missing as missing:
        _say(f"{missing}; start each with: python -m agent --router {router} --fleet {keys.fleet} --robot NAME ...")
        return UNKNOWN
    finally:
        air.close()
        link.close()
    if options.lifeline is not None:
        return 0  # the journal is whole; the launcher judges it
    code = _judge(options.out, prepared, wall_s)
    return EXIT_INTERRUPTED if ending else code


def _gather(link: Link, keys: FleetKeys, scenario: Scenario, wait_s: float, ending: Ending) -> Seats:
    """Listen to the robots, say that there is a world, and wait until somebody has come for each robot."""
    from patrol.net.keys import WORLD
    from patrol.net.link import Mailbox, Presence
    from patrol.net.phases import MAX_REPLY, ToWorld, decode_to_world
    from patrol.scenario import scenario_hash
    from worldsim.fleet.sessions import Seats, Wire
    from worldsim.timeline import Timeline

    names = {spec.number: spec.name for spec in scenario.roster}
    accepted = [keys.alive(WORLD), *(key for name in names.values() for key in (keys.reply(name), keys.alive(name)))]
    mailbox: Mailbox[ToWorld | Presence] = Mailbox(accepted, decode_to_world, MAX_REPLY)
    if link.sees(keys.alive(WORLD)):
        raise BadInput(
            f"--fleet {keys.fleet}: a world of this fleet is running already; choose another name, or end that one"
        )
    lockstep = scenario.factor is None  # it sends again what got lost; at a pace the world waits for nobody
    posts = {number: link.post(keys.tick(name), waits=lockstep) for number, name in names.items()}
    wire = Wire(keys, names, posts, mailbox, lambda: link.connected, time.monotonic, lambda: bool(ending))
    run = int.from_bytes(os.urandom(8), "big") >> 1 | 1
    seats = Seats(wire, run, scenario_hash(scenario), Timeline(scenario).starts_absent)
    link.subscribe(keys.reply("*"), mailbox)
    link.watch(keys.alive("*"), mailbox)
    link.live(keys.alive(WORLD))
    seats.gather(wait_s, lambda missing, s: _say(f"waiting for {', '.join(missing[:8])} ({s:.0f} s)"))
    return seats


def _ear(link: Link, air: Air, keys: FleetKeys, scenario: Scenario) -> Ear:
    """Overhear what robots tell each other on the air, and what they say of it over the fleet's link."""
    from patrol.net.link import Mailbox
    from patrol.net.telemetry import read_traffic
    from patrol.radio.message import MAX_FRAME
    from worldsim.radio.listener import MAX_TRAFFIC, ROOM, Ear

    numbers = {spec.name: spec.number for spec in scenario.roster}
    positions = Mailbox([keys.position(name) for name in numbers], bytes, MAX_FRAME, ROOM)
    telemetry = Mailbox([keys.telemetry(name) for name in numbers], read_traffic, MAX_TRAFFIC * len(numbers), room=1)
    air.subscribe(keys.position("*"), positions)
    link.subscribe(keys.telemetry("*"), telemetry)
    return Ear(keys, numbers, positions, telemetry, time.monotonic)


def _record(
    options: argparse.Namespace,
    prepared: Prepared,
    link: Link,
    keys: FleetKeys,
    seats: Seats,
    ear: Ear | None,
    ending: Ending,
) -> float:
    """Run the ticks and write down what happens; the wall time that they took (s)."""
    from patrol.journal import JournalWriter
    from worldsim.fleet.lockstep import LockstepFleet
    from worldsim.fleet.loop import run_ticks
    from worldsim.fleet.paced import PacedFleet
    from worldsim.fleet.process_control import SeatedHands
    from worldsim.fleet.sessions import Interrupted
    from worldsim.output.folder import keep
    from worldsim.output.record import Recorder, header_of
    from worldsim.output.ticks_table import TicksTable
    from worldsim.run_record import INTERRUPTED
    from worldsim.world import World

    scenario = prepared.scenario
    world = World(prepared, operated=options.token is not None)
    fleet: LockstepFleet | PacedFleet
    if scenario.factor is None:
        fleet = LockstepFleet(seats, options.deadline)
    else:
        fleet = PacedFleet(seats, scenario.step / scenario.factor, ear)
    hands = None
    if options.hands is not None:
        hands = SeatedHands(_asking(options.hands, ending), seats, waits=scenario.factor is None)
    operator = None if options.token is None else _operator(options, world, fleet, link, keys)
    header = header_of(world, datetime.now(UTC).isoformat(timespec="seconds"))
    with (
        JournalWriter(options.out / "journal", header) as journal,
        closing(TicksTable(options.out / "ticks.csv", scenario.step)) as table,
    ):
        if options.lifeline is None:
            keep(scenario, options.scenario, options.out)
        feed = _feed(world, journal, header, link, keys, lambda: _manner(world, operator))
        if operator is not None:
            operator.rest = feed.rest
        recorder = Recorder(feed, scenario.spares)
        on_tick, on_event = _sinks(world, link, keys, recorder, table, feed.between)
        reason = INTERRUPTED
        began = time.monotonic()
        try:
            reason = run_ticks(world, fleet, on_tick, on_event, lambda: bool(ending), hands, operator)
        except Interrupted:
            pass
        except BaseException as error:
            reason = f"failed: {type(error).__name__}: {error}"
            raise
        finally:
            wall_s = time.monotonic() - began
            recorder.end(reason, {"wall_s": wall_s, "refused": dict(seats.refused), **fleet.notes()})
            feed.flush()
    return wall_s


def _operator(
    options: argparse.Namespace, world: World, fleet: LockstepFleet | PacedFleet, link: Link, keys: FleetKeys
) -> Operator:
    """Does what whoever has the fleet's token asks for, and keeps the scenario that it comes to."""
    from patrol.net.link import Mailbox
    from patrol.scenario.controls import ASK, MAX_CONTROL
    from worldsim.operator import Operator
    from worldsim.requests import FrontDesk, keep_timeline

    key = keys.control(ASK)
    mailbox: Mailbox[Question] = Mailbox([key], _unread, MAX_CONTROL)
    desk = FrontDesk(mailbox, options.token)
    operator = Operator(
        world,
        fleet,
        desk,
        time.monotonic,
        handy=options.hands is not None,
        amended=lambda scenario: keep_timeline(options.out, scenario),
    )
    link.attend(key, MAX_CONTROL, mailbox)
    return operator


def _manner(world: World, operator: Operator | None) -> Manner:
    """How the ticks go, with an operator or without."""
    from worldsim.operator import Manner

    return Manner(True, world.scenario.factor) if operator is None else operator.manner


def _feed(
    world: World, journal: JournalWriter, header: Header, link: Link, keys: FleetKeys, manner: Callable[[], Manner]
) -> Feed:
    """Shows the journal to whoever watches, and tells who comes late what was before."""
    from patrol.net.feed import FOG, TICKS
    from patrol.net.link import Mailbox
    from worldsim.output.feed_publisher import Feed

    key = keys.truth(FOG)
    questions: Mailbox[Question] = Mailbox([key], _unread, 0)

    def later(work: Callable[[], None]) -> None:
        threading.Thread(target=work, name="fog", daemon=True).start()

    feed = Feed(world, journal, header, link.show(keys.truth(TICKS)), questions, later, time.monotonic, manner)
    link.attend(key, 0, questions)
    return feed


def _unread(_payload: bytes) -> Question:
    """Questions are put into their mailbox as they are."""
    raise ValueError("no question")


def _asking(descriptor: int, ending: Ending) -> Callable[[bytes], bytes]:
    """Asks the launcher, one line for each request and answer, over the socket that it has handed down."""
    from worldsim.fleet.process_control import Handless
    from worldsim.fleet.sessions import Interrupted

    end = socket.socket(fileno=descriptor)
    lines = end.makefile("rb")

    def ask(line: bytes) -> bytes:
        answer = b""
        with suppress(OSError):
            end.sendall(line)
            answer = lines.readline()
        if not answer.endswith(b"\n"):
            if ending.wait(HANDS_GONE_S):  # the launcher is leaving, or has died
                raise Interrupted
            raise Handless("the launcher does not answer")
        return answer

    return ask


def _check_hands(scenario: Scenario, descriptor: int | None) -> None:
    """Whoever started the robots is there to kill, pause and start them where the scenario wants that."""
    from worldsim.fleet.acts import HANDS_NEEDED
    from worldsim.timeline import Timeline

    if descriptor is None and Timeline(scenario).needs_hands:
        raise BadInput(HANDS_NEEDED)


def _sinks(
    world: World,
    link: Link,
    keys: FleetKeys,
    recorder: Recorder,
    table: TicksTable,
    between: Callable[[], None],
) -> tuple[Callable[[TickRecord], None], Callable[[Event], None]]:
    """Where ticks and events go: into the files, and before the eyes of whoever looks."""
    from patrol.net.telemetry import EVENTS, METRICS, Watcher, show

    scenario = world.scenario
    names = {spec.number: spec.name for spec in scenario.roster}
    watcher = Watcher(names, world.truth.fog.points, scenario.step, scenario.ticks, time.monotonic)
    to_metrics, to_events = link.show(keys.truth(METRICS)), link.show(keys.truth(EVENTS))

    def on_tick(record: TickRecord) -> None:
        recorder.tick(record)
        table.tick(record)
        metrics = watcher.take(record)
        if metrics is not None:
            to_metrics(show(metrics))
        between()

    def on_event(event: Event) -> None:
        recorder.event(event)
        notice = watcher.notice(event)
        to_events(show(notice))
        _say(" ".join(part for part in (f"tick {event.k}:", notice.robot, f"{event.kind}:", event.detail) if part))

    return on_tick, on_event


def _judge(out: Path, prepared: Prepared, wall_s: float) -> int:
    """Summarise and judge a run whose agents somebody else has started; the exit code."""
    from patrol.journal import read_journal
    from worldsim.output.summary import summarise
    from worldsim.verdict.judge import judge

    journal = read_journal(out / "journal")
    verdict = judge(journal, {}, prepared)
    summary = summarise(journal, verdict, wall_s)
    (out / "summary.json").write_text(f"{json.dumps(summary, indent=2)}\n", encoding="utf-8")
    mean = summary["mfow_mean_s"]
    mfow = "no ticks" if mean is None else f"mean MFoW {mean:.1f} s"
    _say(f"verdict {verdict.outcome}, {mfow}; see {out / 'summary.json'}")
    for check in verdict.failed:
        _say(f"  {check.name}: {check.detail}")
    return verdict.exit_code


def _say(line: str) -> None:
    print(f"world: {line}", file=sys.stderr, flush=True)


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = fleet_parser("worldsim", "The world of a simulated fleet, as a process.", HELP, "router and robots")
    add = parser.add_argument
    add("--out", required=True, type=Path, metavar="DIR", help="folder for the journal and ticks.csv")
    add("--deadline", type=float, default=10.0, metavar="S", help="lockstep: wall time for an answer (%(default)g s)")
    add("--control", type=Path, metavar="FILE", help="obey operators who have the token in this file (default: nobody)")
    add("--hands", type=int, metavar="FD", help="socket to ask for kills, pauses and starts (set by the launcher)")
    return parser.parse_args(arguments)
