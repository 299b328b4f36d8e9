"""A patrol of robots without a world: what follows from the positions they send and from what they say of themselves.

Nobody tells the truth here. A tick is a step of wall time since the viewer began; what was before, it does not know.
"""

from __future__ import annotations

import time
from array import array
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from monitor.live.follow import HEARD
from monitor.observer import NOBODY, Listener
from monitor.source import Answer, Layer, RobotShape, RobotState, Series, State, Static
from patrol.errors import BadInput
from patrol.ground.footprint import sensor_footprint
from patrol.journal.records import Event, Status
from patrol.net.mailbox import Mailbox, Presence
from patrol.net.telemetry import Telemetry, read_telemetry
from patrol.radio.fleet_key import fleet_key
from patrol.radio.inbox import inbox_of
from patrol.radio.message import MAX_FRAME
from patrol.scenario import as_mapping

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from patrol.net.keys import FleetKeys
    from patrol.net.link import Link
    from patrol.net.mailbox import Air
    from patrol.prepare import Prepared

MAX_TELEMETRY = 1 << 16
COME, GONE = "there", "gone"
"""Kinds of events: a robot's process has shown itself, or is to be seen no more."""


class EarSource:
    """A `monitor.source.Source` that only listens. air: where positions are sent. now: wall clock, s."""

    def __init__(
        self, keys: FleetKeys, prepared: Prepared, link: Link, air: Air, now: Callable[[], float] = time.monotonic
    ) -> None:
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
            self._unknown = ""
        except BadInput:
            key = None
            self._unknown = "; tags are not checked, for the fleet's key is not here"
        inbox = inbox_of(scenario, NOBODY, prepared.terrain.bounds, key, knows_ticks=False)
        footprint = sensor_footprint(scenario, prepared.terrain)
        self._listener = Listener(footprint, prepared.patrolled, inbox, scenario.step)
        positions = {keys.position(name): number for name, number in self._names.items()}
        telemetry = {keys.telemetry(name): number for name, number in self._names.items()}
        tokens = {keys.alive(name): number for name, number in self._names.items()}
        self._number_of = {**telemetry, **tokens}
        self._frames: Mailbox[bytes] = Mailbox(positions, bytes, MAX_FRAME)
        self._said: Mailbox[Telemetry | Presence] = Mailbox([*telemetry, *tokens], read_telemetry, MAX_TELEMETRY)
        self._views: dict[int, Telemetry] = {}
        self._present: set[int] = set()
        self._events: list[Event] = []
        self._ticks, self._mfow, self._mean = array("q"), array("d"), array("d")
        self._k = -1
        air.subscribe(keys.position("*"), self._frames)
        link.subscribe(keys.telemetry("*"), self._said)
        link.watch(keys.alive("*"), self._said)

    def static(self) -> Static:
        """What never changes."""
        sensor, terrain = self._scenario.sensor, self._prepared.terrain
        return Static(
            name=self._name,
            scenario=as_mapping(self._scenario),
            passable=terrain.passable,
            patrolled=self._prepared.patrolled,
            point=terrain.point,
            origin=terrain.origin,
            robots=tuple(
                RobotShape(spec.number, spec.name, spec.model, spec.radius, sensor.range, sensor.angle)
                for spec in self._roster
            ),
            step=self._scenario.step,
            ticks=None,
            bound_s=None,
            live=True,
            layers=(HEARD,),
            direct=self._scenario.radio.via == "direct",
            note=f"positions alone: nobody tells the truth here, nor what was before{self._unknown}",
        )

    def wait(self, timeout_s: float) -> State | None:
        """The state once another tick of wall time is over, or None after `timeout_s`."""
        until = self._now() + timeout_s
        while True:
            now = self._now()
            k = int((now - self._began) / self._scenario.step)
            if k > self._k:
                self._close(k)
                return self._state()
            if now >= until:
                return None
            next_tick = self._began + (self._k + 1) * self._scenario.step
            arrived = self._frames.get(max(0.0, min(until, next_tick) - now))
            if arrived is not None:
                self._listener.hear(max(self._k, 0), [arrived[1]])

    def last_seen(self, layer: Layer) -> NDArray[np.int32] | None:
        """The tick in which each point was last seen, as heard."""
        return self._listener.fog.last_seen if layer == HEARD else None

    def since(self, layer: Layer) -> int:  # noqa: ARG002 - its time begins when it does
        """See `Source`."""
        return 0

    def tick(self, layer: Layer) -> int:  # noqa: ARG002 - there is one fog
        """See `Source`."""
        return self._k

    def keep(self, layers: Collection[Layer]) -> None:
        """See `Source`; it is kept up all the time."""

    def trail(self, first: int, last: int) -> None:
        """The page remembers."""

    def series(self, after: int) -> Series:
        """MFoW and mean fog as heard, in ticks after `after`."""
        ticks = np.array(self._ticks, dtype=np.int64)
        first = int(np.searchsorted(ticks, after, side="right"))
        step = self._scenario.step
        mfow, mean = (np.array(values[first:], dtype=np.float64) * step for values in (self._mfow, self._mean))
        return Series(ticks[first:], mfow, mean)

    def events(self, since: int) -> Sequence[Event]:
        """Who has come and gone."""
        return self._events[since:]

    def ask(self, control: Mapping[str, Any]) -> Answer:  # noqa: ARG002 - whatever it is
        """Nobody is there to ask."""
        return Answer(False, "robots without a world take no controls")

    def close(self) -> None:
        """No more is wanted."""
        for link in self._links:
            link.close()

    def _close(self, k: int) -> None:
        """Tick k begins: what has come by then counts for the ticks before it."""
        while (arrived := self._frames.get()) is not None:
            self._listener.hear(max(k - 1, 0), [arrived[1]])
        while (said := self._said.get()) is not None:
            number, message = self._number_of[said[0]], said[1]
            if isinstance(message, Telemetry):
                self._views[number] = message
            elif message.present != (number in self._present):
                (self._present.add if message.present else self._present.discard)(number)
                self._events.append(Event(k, COME if message.present else GONE, number))
        self._k = k
        fog = self._listener.fog
        self._ticks.append(k)
        self._mfow.append(fog.mfow(k))
        self._mean.append(fog.mean(k))

    def _state(self) -> State:
        step = self._scenario.step
        return State(
            k=self._k,
            time_s=self._k * step,
            running=True,
            pace=1.0,
            ticks_per_s=1.0 / step,
            robots=tuple(self._robot(spec.number) for spec in self._roster),
            mfow_s=self._mfow[-1] * step,
            fog_mean_s=self._mean[-1] * step,
            note="" if self._listener.peers else "no position heard yet",
        )

    def _robot(self, number: int) -> RobotState:
        peer, view = self._listener.peers.get(number), self._views.get(number)
        heard_s = None if peer is None else max(0, self._k - peer.tick) * self._scenario.step
        silent = heard_s is None or heard_s > self._scenario.radio.forget_after
        if silent:
            status = Status.ABSENT if heard_s is None and number not in self._present else Status.LOST
        else:
            status = Status.ALIVE
        return RobotState(
            number=number,
            status=status,
            state="" if view is None else view.state,
            pose=None if peer is None else peer.pose,
            goal=None if view is None else view.refined or view.goal,
            decision_ms=None if view is None else view.decision_ms,
            heard_s=heard_s,
            rejected=None if view is None else view.rejected,
        )
