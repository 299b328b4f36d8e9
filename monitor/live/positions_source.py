"""The source for robots without a world: their positions, and their reports about themselves.

The truth is unknown. A tick is a step of wall time since the viewer started; what happened before is unknown, too.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from monitor.live.fog_tracker import HEARD
from monitor.observation.hearing import Hearing
from monitor.observation.listener import NO_ROBOT, Listener
from monitor.observation.source import Answer, Layer, RobotShape, RobotState, Series, SeriesLog, Source, State, Static
from monitor.observation.traps import TrapWatch
from patrol.errors import BadInput
from patrol.journal.records import Event, RobotTick, Status, TickRecord
from patrol.prepare import inboxes_of, sensor_footprint
from patrol.scenario import as_mapping
from patrol.scenario.marks import looks_at
from patrol.wire import read
from runtime.messages.stop_orders import Order, ask_robots, robots_to_ask
from runtime.messages.telemetry import Telemetry
from runtime.net.mailbox import FrameMailbox, Mailbox, Presence
from runtime.security.keys import robot_of
from runtime.security.private_files import fleet_key

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from patrol.pose import Pose
    from patrol.prepare import Prepared
    from runtime.net.link import Link
    from runtime.net.mailbox import Air
    from runtime.security.keys import FleetKeys

MAX_TELEMETRY = 1 << 16
ROBOTS_S = 5.0
"""Longest wait for robots to answer an order, s."""
CONNECTED, DISCONNECTED = "connected", "disconnected"
"""Kinds of events: a robot's process has connected, or has disconnected."""


class PositionsSource(Source):
    """A `monitor.observation.source.Source` that only listens."""

    def __init__(
        self,
        keys: FleetKeys,
        prepared: Prepared,
        link: Link,
        air: Air,
        now: Callable[[], float] = time.monotonic,
        *,
        may_stop: bool = False,
    ) -> None:
        """Start to listen.

        `air` is the link on which robots send positions; it may be the same as `link`. With `may_stop` this viewer may
        tell robots to stop: as an operator, or where no router asks for its role.
        """
        self._keys, self._may_stop = keys, may_stop
        scenario = self._scenario = prepared.scenario
        self._prepared = prepared
        self._name = keys.fleet
        self._links = (link, air)
        self._now = now
        self._began = now()
        self._roster = scenario.roster
        self._names = {spec.name: spec.number for spec in self._roster}
        try:
            key = fleet_key(scenario.radio.key)
            self._unchecked = ""
        except BadInput:
            key = None
            self._unchecked = "; the fleet's key is not available, so authentication tags are not checked"
        inboxes = inboxes_of(scenario, [NO_ROBOT], prepared.terrain.bounds, key, knows_ticks=False)
        footprint = sensor_footprint(scenario, prepared.terrain)
        self._listener = Listener(footprint, prepared.patrolled, inboxes, NO_ROBOT)
        positions = {keys.position(name): number for name, number in self._names.items()}
        telemetry = {keys.telemetry(name): number for name, number in self._names.items()}
        tokens = {keys.alive(name): number for name, number in self._names.items()}
        self._number_of = {**telemetry, **tokens}
        self._frames = FrameMailbox(positions)
        self._reports: Mailbox[Telemetry | Presence] = Mailbox(
            [*telemetry, *tokens], partial(read, Telemetry), MAX_TELEMETRY
        )
        self._traps = TrapWatch(prepared, from_start=False)
        self._views: dict[int, Telemetry] = {}
        self._hearing = Hearing()
        self._present: set[str] = set()
        self._events: list[Event] = []
        self._series = SeriesLog(scenario.step)
        self._k = -1
        air.subscribe(keys.position("*"), self._frames)
        link.subscribe(keys.telemetry("*"), self._reports)
        link.watch(keys.alive("*"), self._reports)

    def static(self) -> Static:
        """See `Source`."""
        return Static(
            name=self._name,
            scenario=as_mapping(self._scenario),
            terrain=self._prepared.terrain,
            patrolled=self._prepared.patrolled,
            robots=RobotShape.all_of(self._scenario),
            step=self._scenario.step,
            ticks=None,
            bound_s=None,
            live=True,
            layers=(HEARD,),
            direct=self._scenario.radio.via == "direct",
            controls=tuple(Order) if self._may_stop else (),
            note=f"shown are the positions heard since this page was started; the true fog is unknown{self._unchecked}",
        )

    def wait(self, timeout_s: float) -> State | None:
        """See `Source`; a state for each tick of wall time."""
        until = self._now() + timeout_s
        while True:
            now = self._now()
            # Ticks of wall time: a viewer that was busy leaves some out.
            k = int((now - self._began) / self._scenario.step)
            if k > self._k:
                self._start_tick(k)
                return self._make_state()
            if now >= until:
                return None
            next_tick = self._began + (self._k + 1) * self._scenario.step
            arrived = self._frames.get(max(0.0, min(until, next_tick) - now))
            if arrived is not None:
                self._hear_frame(max(self._k, 0), *arrived)

    def last_seen(self, layer: Layer) -> NDArray[np.int32] | None:
        """See `Source`."""
        return self._listener.fog.last_seen if layer == HEARD else None

    def tick(self, layer: Layer) -> int:  # noqa: ARG002 - it has one fog
        """See `Source`."""
        return self._k

    def series(self, after: int) -> Series:
        """See `Source`."""
        return self._series.after(after)

    def events(self, since: int) -> Sequence[Event]:
        """See `Source`; robots that have connected and disconnected."""
        return self._events[since:]

    def control(self, control: Mapping[str, Any]) -> Answer:
        """See `Source`; only stop and release, for all robots, each of which answers for itself."""
        order = next((order for order in Order if order == control.get("do")), None)
        if order is None or not self._may_stop:
            return Answer(False, "robots without a world accept stop and release only, from an operator's page")
        link = self._links[0]
        silent = set(robots_to_ask(link, self._keys))
        if not silent:
            return Answer(False, "no robot is there")
        succeeded, says = True, []
        for name, outcome in ask_robots(link, self._keys, sorted(silent), order, ROBOTS_S):
            silent.discard(name)
            succeeded = succeeded and outcome.done
            says.append(f"{name}: {outcome.text}")
        says += [f"{name}: no answer; use another way" for name in sorted(silent)]
        return Answer(succeeded and not silent, "; ".join(says))

    def close(self) -> None:
        """See `Source`."""
        for link in self._links:
            link.close()

    def _start_tick(self, k: int) -> None:
        """Start tick k; frames that have arrived so far count for the ticks before it."""
        while (arrived := self._frames.get()) is not None:
            self._hear_frame(max(k - 1, 0), *arrived)
        while (report := self._reports.get()) is not None:
            number, message = self._number_of[report[0]], report[1]
            if isinstance(message, Telemetry):
                self._views[number] = message
                self._hearing.take(robot_of(report[0]), message.traffic)
            elif message.present != ((name := robot_of(report[0])) in self._present):
                (self._present.add if message.present else self._present.discard)(name)
                self._events.append(Event(k, CONNECTED if message.present else DISCONNECTED, number))
        self._k = k
        fog = self._listener.fog
        self._series.add(k, fog.mfow(k), fog.mean(k))
        self._events += self._traps.tick(self._heard_record(k), lambda: fog.last_seen)

    def _hear_frame(self, k: int, key: str, frame: bytes) -> None:
        self._hearing.sent(robot_of(key))
        self._listener.hear(k, [frame])

    def _heard_record(self, k: int) -> TickRecord:
        """Return the robots' poses, as heard."""
        robots = map(self._robot_state, self._names.values())
        rows = tuple(_robot_row(robot, robot.pose) for robot in robots if robot.pose is not None)
        return TickRecord(k, rows, (), (), (), 0, 0.0, 0)

    def _make_state(self) -> State:
        step, fog = self._scenario.step, self._listener.fog
        return State(
            k=self._k,
            time_s=self._k * step,
            running=True,
            pace=1.0,
            ticks_per_s=1.0 / step,
            robots=tuple(self._robot_state(spec.number) for spec in self._roster),
            looks=looks_at(self._scenario, self._k),
            mfow_s=fog.mfow(self._k) * step,
            fog_mean_s=fog.mean(self._k) * step,
            note="" if self._listener.peers else "no position received yet",
        )

    def _robot_state(self, number: int) -> RobotState:
        peer, view = self._listener.peers.get(number), self._views.get(number)
        name = self._roster[number - 1].name
        heard_s = None if peer is None else max(0, self._k - peer.tick) * self._scenario.step
        stopped = None if view is None else stop_text(view.stopped)
        # As robots judge it themselves.
        silent = heard_s is None or heard_s > self._scenario.radio.forget_after
        if silent:
            status = Status.ABSENT if heard_s is None and name not in self._present else Status.LOST
        else:
            status = Status.ALIVE if stopped is None else Status.PAUSED
        return RobotState(
            number=number,
            status=status,
            state="" if view is None else stopped or view.state,
            pose=None if peer is None else peer.pose,
            goal=None if view is None else view.refined or view.goal,
            decision_ms=None if view is None else view.decision_ms,
            heard_s=heard_s,
            trapped=self._traps.trapped(number),
            charge=None if view is None else view.charge,
            radio_wrong=self._hearing.wrong(name, self._present),
        )


def stop_text(stopped: str) -> str | None:
    """Return why a robot is stopped, without what ends that; None for one that may drive.

    For example, "it was halted" for "it was halted (fogwatch control ... release)".
    """
    return re.sub(r" \([^()]*\)", "", stopped) or None


def _robot_row(robot: RobotState, pose: Pose) -> RobotTick:
    """Return a robot as in a tick of the journal, without the fields that no robot reports."""
    place, command = (pose.x, pose.y, pose.heading), (0.0, 0.0)
    return RobotTick(
        robot.number,
        robot.status,
        *place,
        *command,
        bumped=False,
        state=robot.state,
        goal=None,
        decision_ms=None,
        rejected=None,
    )
