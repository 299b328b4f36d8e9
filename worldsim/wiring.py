"""Connects the parts of a world to the fleet's network, its files and its launcher."""

from __future__ import annotations

import os
import socket
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING

from patrol.errors import BadInput, printable
from patrol.journal import Event, Header, JournalWriter, Status, TickRecord
from patrol.journal.records import standing_after
from patrol.radio.message import MAX_FRAME
from patrol.scenario import Scenario, scenario_hash
from runtime.messages.feed import FOG, TICKS
from runtime.messages.phases import MAX_REPLY, ToWorld, decode_to_world
from runtime.messages.session import MESH_RETURN_S, RETURN_S, WorldRun
from runtime.messages.telemetry import (
    EVENTS,
    MAX_TEXT,
    METRICS,
    NOT_RECORDED,
    TRAPPED,
    WAITS,
    Notice,
    pack_view,
    read_traffic,
)
from runtime.net.link import Link
from runtime.net.mailbox import Air, Mailbox, Post, Presence, Question
from runtime.reporting.logs import Log
from runtime.reporting.vitals import MFOW, ROBOTS, ROUTER_SILENT
from runtime.security.control_auth import ASK, CHALLENGE, MAX_REQUEST, NONCE, ControlGate
from runtime.security.keys import WORLD, FleetKeys
from worldsim.controls import ControlMailbox, Operator, RunState, answer_challenge, keep_timeline
from worldsim.faults import Timeline
from worldsim.fleet.lockstep import LockstepFleet
from worldsim.fleet.paced import PacedFleet
from worldsim.fleet.process_control import ControlFailed, LauncherControl, has_ended
from worldsim.fleet.router_watch import RouterWatch
from worldsim.fleet.sessions import FleetConnection, Interrupted, Sessions
from worldsim.output.feed_publisher import MOST_ASKING, Feed
from worldsim.output.live_progress import LiveProgress
from worldsim.radio.listener import MAX_TRAFFIC, ROOM, Listener
from worldsim.run_record import PutOff, Unwritten, recording

if TYPE_CHECKING:
    from argparse import Namespace

    from runtime.process.context import ProcessContext
    from runtime.process.lifeline import Ending
    from worldsim.output.record import Recorder
    from worldsim.output.ticks_table import TicksTable
    from worldsim.world import World

LAUNCHER_GONE_S = 2.0
"""Longest time from the launcher's last answer to its request to end, s."""

CHALLENGE_S = 2.0
"""Time that the thread for operators' tickets waits for a request at once, s."""

TICKET_S = 0.005
"""Least time between two tickets for operators, s, so that asking for them in a flood costs the ticks little."""

_STATUSES = tuple(status.name.lower() for status in Status)


def _random_run() -> int:
    # 63 bits, which a signed number of 64 holds, and never 0.
    return int.from_bytes(os.urandom(8), "big") >> 1 | 1


@dataclass(frozen=True)
class Wiring:
    """The connections of a world's process."""

    process: ProcessContext
    scenario: Scenario
    keys: FleetKeys
    link: Link  # to the fleet's router
    outward: Link  # to the router for viewers, so that one that stops reading holds up only this link
    air: Air  # carries frames where robots hear each other directly
    run: int = field(default_factory=_random_run)  # random number of the run

    @property
    def options(self) -> Namespace:
        """The process's command line."""
        return self.process.options

    @property
    def log(self) -> Log:
        """The process's log."""
        return self.process.log

    @cached_property
    def router(self) -> RouterWatch:
        """Says whether the router answers."""
        token = self.keys.alive(WORLD)
        return RouterWatch(lambda: self.link.connected, lambda: self.link.echo(token), time.monotonic, self.log.warning)

    def leaving(self) -> bool:
        """Return True if the process should end; each wait and each loop asks this in each round."""
        self.process.notifier.alive()
        return bool(self.process.ending)

    @cached_property
    def to_events(self) -> Post:
        """Tells viewers what happens."""
        return self.outward.publisher(self.keys.truth(EVENTS))

    def waiting(self, missing: list[str], waited_s: float, k: int = 0) -> None:
        """Say which robots the world waits for."""
        names = ", ".join(missing[:8])
        self.log.info(f"waiting for {names} ({waited_s:.0f} s)")
        self.to_events(pack_view(Notice(k, WAITS, "", f"for {names}"[:MAX_TEXT])))

    def gather(self) -> Sessions:
        """Announce the world and wait until each robot's process has come.

        `Missing` is raised if robots have not come in time, and `Interrupted` if the process should end.
        """
        keys, link = self.keys, self.link
        names = {spec.number: spec.name for spec in self.scenario.roster}
        robots = [make(name) for name in names.values() for make in (keys.reply, keys.alive)]
        mailbox: Mailbox[ToWorld | Presence] = Mailbox([keys.alive(WORLD), *robots], decode_to_world, MAX_REPLY)
        if link.sees(keys.alive(WORLD)):
            raise BadInput(
                f"--fleet {keys.fleet}: a world of this fleet is running already; choose another name, or end that one"
            )
        lockstep = self.scenario.factor is None  # it sends again what got lost; at a pace the world waits for no robot
        posts = {number: link.post(keys.tick(name), waits=lockstep, together=True) for number, name in names.items()}
        has_ended_for = None if self._ask_launcher is None else partial(has_ended, self._ask_launcher)
        connection = FleetConnection(
            keys, names, posts, mailbox, self.router.settled, time.monotonic, self.leaving, has_ended_for
        )
        absent = Timeline(self.scenario).starts_absent
        # In lockstep all others stand while one is waited for.
        return_s = MESH_RETURN_S if link.mesh is not None and not lockstep else RETURN_S
        sessions = Sessions(connection, WorldRun(self.run, scenario_hash(self.scenario), return_s), absent)
        # The token comes last: a robot that sees it may answer at once.
        link.subscribe(keys.reply("*"), mailbox)
        link.watch(keys.alive("*"), mailbox)
        link.live(keys.alive(WORLD))
        self.process.vitals.probe_mailbox(mailbox)
        self.process.vitals.probe(ROUTER_SILENT, lambda: self.router.silent_s)

        # A launcher notices when a robot's process ends; where it has started many at once, they take their time.
        sessions.gather(self.process.patience_s, self.waiting)
        return sessions

    def listener(self) -> Listener | None:
        """Make the listener to a direct radio; None where the world carries the frames."""
        if self.scenario.radio.via != "direct":
            return None
        keys = self.keys
        numbers = {spec.name: spec.number for spec in self.scenario.roster}
        positions = Mailbox([keys.position(name) for name in numbers], bytes, MAX_FRAME, ROOM)
        longest = MAX_TRAFFIC * len(numbers)
        # Room for one of each robot: its counts only grow, so the newest report says all.
        telemetry = Mailbox([keys.telemetry(name) for name in numbers], read_traffic, longest, room=1)
        self.air.subscribe(keys.position("*"), positions)
        self.link.subscribe(keys.telemetry("*"), telemetry)
        return Listener(keys, numbers, positions, telemetry, time.monotonic)

    def fleet(self, sessions: Sessions, listener: Listener | None) -> LockstepFleet | PacedFleet:
        """Make the fleet, in lockstep or at the pace of the clock."""
        if self.scenario.factor is None:
            return LockstepFleet(sessions, self.options.deadline, self.router, self.waiting)
        return PacedFleet(sessions, self.scenario.step / self.scenario.factor, listener, self.router)

    def process_control(self, sessions: Sessions) -> LauncherControl | None:
        """Make the control over robots' processes; None without a launcher."""
        if self._ask_launcher is None:
            return None
        return LauncherControl(self._ask_launcher, sessions, waits=self.scenario.factor is None)

    @cached_property
    def _ask_launcher(self) -> Callable[[bytes], bytes] | None:
        """Asks the launcher for process control; None without one."""
        descriptor = self.options.process_control
        return None if descriptor is None else _make_asker(descriptor, self.process.ending)

    def operator(self, world: World, fleet: LockstepFleet | PacedFleet, token: str | None) -> Operator | None:
        """Make the server of operators that also keeps the scenario as they change it; None without a token."""
        if token is None:
            return None
        key, challenge = self.keys.control(ASK), self.keys.control(CHALLENGE)
        mailbox: Mailbox[Question] = Mailbox([key], _refuse_decoding, MAX_REQUEST)
        challenges: Mailbox[Question] = Mailbox([challenge], _refuse_decoding, NONCE)
        gate = ControlGate(self.keys.fleet, token, self.run, os.urandom(32), time.monotonic)
        operator = Operator(
            world,
            fleet,
            ControlMailbox(mailbox, gate),
            time.monotonic,
            controls_processes=self.options.process_control is not None,
            amended=lambda scenario: keep_timeline(self.options.out, scenario),
        )

        def give_tickets() -> None:
            """Give tickets to operators, also during a tick: otherwise they would wait for two ticks."""
            while True:
                if (arrived := challenges.get(CHALLENGE_S)) is not None:
                    answer_challenge(gate, arrived[1], challenges.refused)
                    time.sleep(TICKET_S)

        threading.Thread(target=give_tickets, name="tickets", daemon=True).start()
        self.link.attend(key, MAX_REQUEST, mailbox)
        self.link.attend(challenge, NONCE, challenges)
        return operator

    def feed(
        self,
        world: World,
        journal: JournalWriter,
        header: Header,
        fleet: LockstepFleet | PacedFleet,
        operator: Operator | None,
    ) -> Feed:
        """Make the feed, which writes the journal and shows it to viewers, also to those that come late."""
        key = self.keys.truth(FOG)
        questions: Mailbox[Question] = Mailbox([key], _refuse_decoding, 0, MOST_ASKING)

        def submit(work: Callable[[], None]) -> None:
            threading.Thread(target=work, name="fog", daemon=True).start()

        def state() -> RunState:
            return RunState(True, self.scenario.factor) if operator is None else operator.state

        post = self.outward.publisher(self.keys.truth(TICKS))
        feed = Feed(world, journal, header, post, questions, submit, time.monotonic, state)
        self.outward.attend(key, 0, questions)

        def meanwhile() -> None:
            if operator is not None:
                operator.during()
            feed.during()

        fleet.meanwhile = meanwhile
        return feed

    def sinks(
        self, world: World, recorder: Recorder, table: TicksTable, between: Callable[[], None]
    ) -> tuple[Callable[[TickRecord], None], Callable[[Event], None]]:
        """Make the receivers of a run's ticks and of its events, for files, viewers and the terminal.

        `between` is called after each tick.
        """
        progress = LiveProgress(world, time.monotonic)
        to_metrics, to_events = self.outward.publisher(self.keys.truth(METRICS)), self.to_events

        @contextmanager
        def recorded(k: int) -> Iterator[None]:
            """Name a failure to viewers too: the log may lie on the same full disk."""
            try:
                with recording(self.options.out):
                    yield
            except Unwritten as unwritten:
                to_events(pack_view(Notice(k, NOT_RECORDED, "", printable(str(unwritten))[:MAX_TEXT])))
                raise

        def on_tick(record: TickRecord) -> None:
            with recorded(record.k):
                recorder.tick(record)
                table.tick(record)
            metrics, notices = progress.tick(record)
            for notice in notices:
                to_events(pack_view(notice))
                tell = self.log.warning if notice.kind == TRAPPED else self.log.info
                tell(f"tick {record.k}: {notice.robot} {notice.detail}")
            if metrics is not None:
                to_metrics(pack_view(metrics))
            if self.process.supervision.counts:
                self._leave_figures(record)
            between()

        def on_event(event: Event) -> None:
            with recorded(event.k):
                recorder.event(event)
            notice = progress.event(event)
            to_events(pack_view(notice))
            tell = self.log.warning if standing_after(event.kind) in (Status.DEAD, Status.LOST) else self.log.info
            tell(" ".join(part for part in (f"tick {event.k}:", notice.robot, f"{event.kind}:", event.detail) if part))

        return on_tick, on_event

    def _leave_figures(self, record: TickRecord) -> None:
        """Publish a tick's figures for those that follow this process."""
        statuses = Counter(robot.status.name.lower() for robot in record.robots)
        mfow_s = record.mfow * self.scenario.step
        self.process.vitals.beat(record.k, {MFOW: mfow_s, ROBOTS: {status: statuses[status] for status in _STATUSES}})
        self.log.debug(f"tick {record.k}: {statuses['alive']} robots alive, MFoW {mfow_s:.1f} s")


def _refuse_decoding(_payload: bytes) -> Question:
    """Raise: questions are put into their mailbox as they are."""
    raise ValueError("no question")


def _make_asker(descriptor: int, ending: Ending) -> Callable[[bytes], bytes]:
    """Make a function that asks the launcher over the inherited socket, one line for each request and answer."""
    end = socket.socket(fileno=descriptor)
    lines = end.makefile("rb")

    def ask(line: bytes) -> bytes:
        answer = b""
        with suppress(OSError):
            end.sendall(line)
            answer = lines.readline()
        if not answer.endswith(b"\n"):
            if ending.wait(LAUNCHER_GONE_S):  # the launcher is leaving, or has died
                raise Interrupted
            raise ControlFailed("the launcher does not answer")
        return answer

    return ask


def put_off(
    later: PutOff,
    world: World,
    fleet: LockstepFleet | PacedFleet,
    operator: Operator | None,
    between: Callable[[], None],
) -> None:
    """Arrange for work that no robot waits for to be done while the world waits for robots.

    This is to finish what is written of the tick before (`later`), and to bring the true fog up to date. Where no tick
    is due, `between` is called now and then.
    """

    def aside() -> None:
        later.settle()  # first: the tick before is reported by its own fog
        world.observe()

    def rest() -> None:
        later.settle()
        between()

    during = fleet.meanwhile

    def meanwhile() -> None:
        later.settle()  # a robot takes its time, so no robot waits for the world
        during()

    fleet.aside = aside
    fleet.meanwhile = meanwhile
    if operator is not None:
        operator.rest = rest
