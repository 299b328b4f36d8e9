"""A patrol that goes on now, as the feed of its world tells: the true fog, and what robots must believe.

The journal's records come in batches (`patrol.net.feed`). Where one is missing, or before the first, the fog so far is
asked of the world. Only the true fog is kept up all the time; what follows from positions heard, by everybody or by one
robot, is computed from the ticks remembered once somebody wants to see it.
"""

from __future__ import annotations

import json
import time
from array import array
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from monitor.live.follow import HEARD, Follower, Followers
from monitor.observer import as_sent
from monitor.source import Answer, Layer, Links, RobotShape, RobotState, Series, State, Static
from monitor.tally import tally
from patrol.errors import BadInput
from patrol.ground.fog import Fog
from patrol.ground.footprint import sensor_footprint
from patrol.ground.terrain import Terrain
from patrol.journal import unpack
from patrol.journal.records import FORGED, End, Event, Header, Status, TickRecord
from patrol.net.feed import Batch, Garbled, SoFar, read_so_far
from patrol.pose import Pose
from patrol.radio.fleet_key import fleet_key
from patrol.scenario import Scenario, load_scenario
from patrol.scenario.controls import CONTROLS, OPERATOR, amended, described, in_force, read_control

if TYPE_CHECKING:
    from monitor.live.wire import Wire

SLICE_S = 0.05
"""Wall time that catching up on a belief may take at a time."""
SLOW_S = 3.0
"""Wall time without news after which a viewer is told."""
AGAIN_S = 5.0
"""Wall time between two questions for the fog."""
LATE_S, LATE_TICKS = 5.0, 20
"""By how much a belief may be behind and is shown still: whichever is more, in simulated time or in ticks."""
REMEMBERED = 48 << 20
"""Bytes of the ticks that are remembered for beliefs."""
PATHS = 256
"""Ticks whose places are remembered for trails."""
BATCHES = 4096
"""Batches that are taken in before a state is shown again."""

_RATE_S = 3.0
_SAMPLE_S = 0.1


class LiveSource:
    """A `monitor.source.Source` over the feed of a world. now: wall clock, s."""

    def __init__(self, name: str, wire: Wire, so_far: SoFar, now: Callable[[], float] = time.monotonic) -> None:
        """name: the fleet's. so_far: an answer of its world. BadInput where that makes no sense."""
        header = _record(so_far.header)
        if not isinstance(header, Header):
            raise BadInput(f"fleet {name}: its world speaks another language; use the same version on all hosts")
        self._name = name
        self._wire = wire
        self._now = now
        self._header = header
        self._ground = so_far.ground
        self._scenario: Scenario = load_scenario(header.scenario)
        self._planned = len(self._scenario.faults)
        facts = header.terrain
        self._terrain = Terrain(facts.name, so_far.ground.passable, facts.point, facts.origin, so_far.ground.keep_out)
        self._footprint = sensor_footprint(self._scenario, self._terrain)
        self._step = self._scenario.step
        self._late = max(LATE_TICKS, round(LATE_S / self._step))
        self._numbers = [robot.number for robot in header.robots]
        self._place = {number: place for place, number in enumerate(self._numbers)}
        self._ended: str | None = None
        self._events: list[Event] = []
        self._next_event = 0
        # With a direct radio the journal has what the world has overheard; what robots have, nobody knows.
        self._direct = self._scenario.radio.via == "direct"
        self._layers: tuple[Layer, ...] = ("truth", HEARD, *(() if self._direct else self._numbers))
        self._followers = Followers(self._follower)
        self._log: deque[tuple[int, bytes]] = deque()
        self._logged = 0
        self._last: TickRecord | None = None
        self._rates: deque[tuple[float, int]] = deque()
        self._paths: deque[NDArray[np.float64]] = deque(maxlen=PATHS)
        self._asked_at = now()
        self._news_at = now()
        self._shown: tuple[object, ...] = ()
        self._begin(so_far)

    # --- Source ------------------------------------------------------------------------------------------------------

    def static(self) -> Static:
        """What never changes."""
        sensor = self._scenario.sensor
        robots = tuple(
            RobotShape(robot.number, robot.name, robot.model, robot.radius, sensor.range, sensor.angle)
            for robot in self._header.robots
        )
        return Static(
            name=self._name,
            scenario=self._header.scenario,
            passable=self._ground.passable,
            patrolled=self._ground.patrolled,
            point=self._terrain.point,
            origin=self._terrain.origin,
            robots=robots,
            step=self._step,
            ticks=self._scenario.ticks,
            bound_s=self._header.bound_s,
            live=True,
            layers=self._layers,
            controls=CONTROLS if self._wire.may_ask else (),
            direct=self._direct,
            late=self._late,
        )

    def wait(self, timeout_s: float) -> State | None:
        """The newest state once it differs from the last one, or None after `timeout_s`."""
        until = self._now() + timeout_s
        while True:
            left = until - self._now()
            batch = self._wire.batch(0.0 if self._followers.behind else max(0.0, left))
            for _ in range(BATCHES):
                if batch is None:
                    break
                self._take(batch)
                batch = self._wire.batch(0.0)
            self._catch_up(min(SLICE_S, max(left, 0.01)))
            self._followers.drop(self._now())
            state = self._state()
            mark = (state.k, state.running, state.pace, state.ended, state.note, len(self._events))
            if mark != self._shown:
                self._shown = mark
                return state
            if left <= 0.0:
                return None

    def last_seen(self, layer: Layer) -> NDArray[np.int32] | None:
        """See `Source`; a belief for which a turn is too short lags, and while it lags too much is not shown."""
        if layer == "truth":
            return self._truth.last_seen
        if layer not in self._layers:
            return None
        follower = self._followers.ask(layer, self._now())
        late = follower.late
        return None if late is None or late > self._late else follower.fog.last_seen

    def tick(self, layer: Layer) -> int:
        """See `Source`."""
        tick = self._followers.tick(layer)
        return self._k if tick is None else tick

    def since(self, layer: Layer) -> int:
        """See `Source`; of a belief, whatever is remembered."""
        return self._followers.since(layer)

    def keep(self, layers: Collection[Layer]) -> None:
        """See `Source`."""
        self._followers.keep([layer for layer in layers if layer != "truth"], self._now())

    def trail(self, first: int, last: int) -> NDArray[np.float64] | None:
        """See `Source`; None where one of these ticks is not remembered."""
        end = 0 if self._last is None else self._last.k + 1
        begin = end - len(self._paths)
        if first < begin or last >= end:
            return None
        return np.stack([self._paths[k - begin] for k in range(first, last + 1)])

    def series(self, after: int) -> Series:
        """What is known of MFoW and mean fog in ticks after `after`."""
        first = bisect_right(self._ticks, after)
        mfow, mean = (np.array(values[first:], dtype=np.float64) * self._step for values in (self._mfow, self._mean))
        return Series(np.array(self._ticks[first:], dtype=np.int64), mfow, mean)

    def events(self, since: int) -> Sequence[Event]:
        """What has happened, from the event numbered `since` on."""
        return self._events[since:]

    def ask(self, control: Mapping[str, Any]) -> Answer:
        """Ask the world for something."""
        if not self._wire.may_ask:
            return Answer(False, "this viewer has no right to control the fleet")
        try:
            read_control(control)
        except BadInput as bad:
            return Answer(False, str(bad))
        return self._wire.ask(control)

    def close(self) -> None:
        """No more is wanted."""
        self._wire.close()

    # --- taking in ---------------------------------------------------------------------------------------------------

    def _begin(self, so_far: SoFar) -> None:
        """Begin, or begin anew, with all so far."""
        self._number = so_far.number
        self._running, self._pace = so_far.running, so_far.pace
        self._truth = Fog.resumed(self._ground.patrolled, so_far.last_seen)
        last = None if so_far.last is None else _record(so_far.last)
        self._last = last if isinstance(last, TickRecord) else None
        self._ticks = array("q", range(0, len(so_far.mfow) * so_far.every, so_far.every))
        self._mfow, self._mean = array("d", so_far.mfow.tolist()), array("d", so_far.fog_mean.tolist())
        self._since = 0 if self._last is None else self._last.k + 1
        self._scenario = load_scenario(self._header.scenario)
        for event in _events(so_far.asked):
            self._amend(event)
        # Places of events that were given out stay; a gap only adds those that were missed and are still to be had.
        self._events += [_shown(event) for event in _events(so_far.events)[max(self._next_event - so_far.event, 0) :]]
        self._next_event = so_far.event + len(so_far.events)
        side = (len(self._numbers),) * 2
        self._links = Links(np.zeros(side, np.int64), np.zeros(side, np.int64), np.full(side, -1, np.int64))
        self._heard: dict[int, int] = {}
        self._rates.clear()
        self._log.clear()
        self._logged = 0
        self._paths.clear()
        self._followers.begin_anew()

    def _take(self, batch: Batch) -> None:
        if batch.first > self._number and not self._ask_anew():
            return
        for number, packed in enumerate(batch.records, start=batch.first):
            if number == self._number:
                self._number += 1
                self._record(packed)
        if batch.first + len(batch.records) >= self._number:
            if (batch.running, batch.pace) != (self._running, self._pace):
                self._rates.clear()
            self._running, self._pace = batch.running, batch.pace
        self._news_at = self._now()

    def _ask_anew(self) -> bool:
        """Something was missed: begin anew with the fog so far, unless that was only just asked for."""
        if self._now() < self._asked_at + AGAIN_S:
            return False
        self._asked_at = self._now()
        with suppress(Garbled):
            so_far = read_so_far(self._wire.so_far() or b"")
            if _record(so_far.header) == self._header:
                self._begin(so_far)
                return True
        return False

    def _record(self, packed: bytes) -> None:
        record = _record(packed)
        match record:
            case TickRecord():
                self._tick(record)
                self._log.append((record.k, packed))
                self._logged += len(packed)
                while self._logged > REMEMBERED:
                    self._logged -= len(self._log.popleft()[1])
            case Event():
                self._amend(record)
                self._events.append(_shown(record))
                self._next_event += 1
            case End():
                self._ended, self._running = record.reason, False

    def _tick(self, record: TickRecord) -> None:
        k = record.k
        places = np.full((len(self._numbers), 2), np.nan)
        for row in record.robots:
            if row.status not in (Status.ABSENT, Status.LEFT):
                places[self._place[row.number]] = row.x, row.y
            if row.status is Status.ALIVE:
                pose = as_sent(row.number, Pose(row.x, row.y, row.heading))
                self._truth.observe(self._footprint.visible(pose), k)
        self._last = record
        self._paths.append(places)
        self._ticks.append(k)
        self._mfow.append(record.mfow)
        self._mean.append(record.fog_mean)
        self._count(record)
        if not self._rates or self._now() >= self._rates[-1][0] + _SAMPLE_S:
            self._rates.append((self._now(), k))

    def _count(self, record: TickRecord) -> None:
        place, links = self._place, self._links
        tally(record, place, links.sent, links.delivered)
        for source, to, _ in record.deliveries:
            if source != FORGED:
                links.heard[place[source], place[to]] = record.k
                self._heard[source] = record.k
        here = sum(row.status not in (Status.ABSENT, Status.LEFT) for row in record.robots)
        if self._direct or here == 1:  # what was sent is all that can be told
            self._heard.update({source: record.k for source, _ in record.frames if source != FORGED})

    def _amend(self, event: Event) -> None:
        if event.kind == OPERATOR:
            try:
                self._scenario, _ = amended(self._scenario, event.k, read_control(json.loads(event.detail)))
            except (BadInput, ValueError):
                return  # of another version, perhaps; the page then lacks an intruder

    # --- beliefs -----------------------------------------------------------------------------------------------------

    def _follower(self, layer: Layer) -> Follower:
        try:
            key = fleet_key(self._scenario.radio.key)
        except BadInput:
            key = None
        number = layer if isinstance(layer, int) else None
        area = self._ground.patrolled if number is None else self._ground.areas[self._ground.area_of[number]]
        facts = (self._scenario, self._terrain, self._footprint, area, self._ground.patrolled)
        return Follower(number, *facts, key, self._log, self._log[0][0] if self._log else self._since)

    def _catch_up(self, limit_s: float) -> None:
        until = self._now() + limit_s
        self._followers.catch_up(lambda: self._now() >= until)

    # --- showing -----------------------------------------------------------------------------------------------------

    @property
    def _k(self) -> int:
        """The tick that is shown."""
        return 0 if self._last is None else self._last.k

    def _state(self) -> State:
        last = self._last
        k, coming = self._k, 0 if last is None else last.k + 1
        return State(
            k=k,
            time_s=k * self._step,
            running=self._running and self._ended is None,
            pace=self._pace,
            ticks_per_s=self._rate(),
            robots=() if last is None else tuple(self._robot(last, place) for place in range(len(self._numbers))),
            mfow_s=None if last is None else last.mfow * self._step,
            fog_mean_s=None if last is None else last.fog_mean * self._step,
            links=None if self._direct else self._links,
            ended=self._ended,
            intruders=tuple(one.place for one in self._scenario.intruders if one.is_there(k * self._step)),
            faults=in_force(self._scenario, coming, self._planned),
            note=self._note(),
            gone=self._ended is None and not self._wire.present,
        )

    def _robot(self, last: TickRecord, place: int) -> RobotState:
        row = last.robots[place]
        heard = self._heard.get(row.number)
        there = row.status not in (Status.ABSENT, Status.LEFT)
        return RobotState(
            number=row.number,
            status=row.status,
            state=row.state,
            pose=Pose(row.x, row.y, row.heading) if there else None,
            goal=row.goal,
            decision_ms=row.decision_ms,
            heard_s=None if heard is None else (last.k - heard) * self._step,
            rejected=row.rejected,
        )

    def _rate(self) -> float:
        """Ticks per wall second over the last `_RATE_S`; 0 while there are none."""
        now = self._now()
        while len(self._rates) > 2 and self._rates[1][0] <= now - _RATE_S:
            self._rates.popleft()
        if self._last is None or not self._rates or not self._running or self._ended is not None:
            return 0.0
        since, before = self._rates[0]
        return (self._last.k - before) / (now - since) if now > since else 0.0

    def _note(self) -> str:
        since = f"watched from {self._since * self._step:g} s on; beliefs and links before that are not known"
        since = since if self._since else ""
        if self._ended is not None:
            return since
        if not self._wire.present:
            return "the world is gone"
        silent_s = self._now() - self._news_at
        silent = f"nothing heard for {silent_s:.0f} s" if self._running and silent_s > SLOW_S else ""
        return " · ".join(filter(None, (silent, since)))


def _record(packed: bytes) -> object:
    try:
        return unpack(packed)
    except ValueError:
        return None


def _events(packed: Sequence[bytes]) -> list[Event]:
    return [event for one in packed if isinstance(event := _record(one), Event)]


def _shown(event: Event) -> Event:
    """An event in words for people."""
    return replace(event, detail=described(event)) if event.kind == OPERATOR else event
