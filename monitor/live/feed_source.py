"""The source for a running fleet with a world: its feed gives the true fog, and from it follow the robots' beliefs.

The journal's records arrive in batches (`patrol.net.feed`). At the start, and whenever a batch is missing, the source
requests the fog so far from the world. Only the true fog is always up to date. The fogs that follow from heard
positions are computed on demand from the ticks kept in memory.
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

from monitor.live.fog_tracker import HEARD, FogTracker, FogTrackers
from monitor.observation.frames import count_frames
from monitor.observation.listener import as_sent
from monitor.observation.source import Answer, Layer, LinkCounts, RobotShape, RobotState, Series, State, Static
from monitor.observation.traps import TrapWatch
from patrol.errors import BadInput
from patrol.ground.fog import Fog
from patrol.ground.terrain import Terrain
from patrol.journal import unpack
from patrol.journal.records import FORGED, End, Event, Header, Status, TickRecord
from patrol.net.feed import Batch, Garbled, SoFar, read_so_far
from patrol.pose import Pose
from patrol.prepare import prepare, sensor_footprint
from patrol.radio.fleet_key import fleet_key
from patrol.scenario import Scenario, load_scenario
from patrol.scenario.controls import CONTROLS, OPERATOR, amended, described, in_force, read_control

if TYPE_CHECKING:
    from monitor.live.feed_client import FeedClient

SLICE_S = 0.05
"""Wall time for computing beliefs between two batches, s."""
SLOW_S = 3.0
"""Wall time without data after which the page says so, s."""
AGAIN_S = 5.0
"""Least wall time between two requests for the fog so far, s."""
LATE_S, LATE_TICKS = 5.0, 20
"""How far a belief may lag and still be shown: in simulated time (s) or in ticks, whichever is more."""
REMEMBERED = 48 << 20
"""Bytes of the ticks that are kept for beliefs."""
PATHS = 256
"""Ticks whose positions are kept for trails."""
BATCHES = 4096
"""Most batches to process between two states."""

_RATE_S = 3.0
_SAMPLE_S = 0.1


class FeedSource:
    """A `monitor.observation.source.Source` that reads the feed of a world."""

    def __init__(self, name: str, client: FeedClient, so_far: SoFar, now: Callable[[], float] = time.monotonic) -> None:
        """Start from the state so far.

        Args:
            name: The fleet's name.
            client: The connection with the world.
            so_far: The state of the run so far, from the world.
            now: Wall clock, s.

        Raises:
            BadInput: The world runs another version.
        """
        header = _record(so_far.header)
        if not isinstance(header, Header):
            raise BadInput(f"--fleet {name}: its world runs another version; use one version on all hosts")
        self._name = name
        self._client = client
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
        # With a direct radio the journal has what the world overheard. What each robot heard is unknown.
        self._direct = self._scenario.radio.via == "direct"
        self._layers: tuple[Layer, ...] = ("truth", HEARD, *(() if self._direct else self._numbers))
        self._trackers = FogTrackers(self._tracker)
        self._traps = TrapWatch(prepare(self._scenario, self._terrain))
        self._log: deque[tuple[int, bytes]] = deque()
        self._logged = 0
        self._last: TickRecord | None = None
        self._rates: deque[tuple[float, int]] = deque()
        self._paths: deque[NDArray[np.float64]] = deque(maxlen=PATHS)
        self._requested_at = now()
        self._received_at = now()
        self._shown: tuple[object, ...] = ()
        self._begin(so_far)

    # --- Source ------------------------------------------------------------------------------------------------------

    def static(self) -> Static:
        """See `Source`."""
        shape = (self._scenario.sensor.range, self._scenario.sensor.angle)
        spares = self._scenario.spares
        robots = tuple(
            RobotShape(robot.number, robot.name, robot.model, robot.radius, *shape, robot.number in spares)
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
            controls=CONTROLS if self._client.may_control else (),
            direct=self._direct,
            late=self._late,
        )

    def wait(self, timeout_s: float) -> State | None:
        """See `Source`."""
        until = self._now() + timeout_s
        while True:
            left = until - self._now()
            batch = self._client.batch(0.0 if self._trackers.behind else max(0.0, left))
            for _ in range(BATCHES):
                if batch is None:
                    break
                self._read(batch)
                batch = self._client.batch(0.0)
            self._catch_up(min(SLICE_S, max(left, 0.01)))
            self._trackers.drop(self._now())
            state = self._state()
            mark = (state.k, state.running, state.pace, state.ended, state.note, len(self._events))
            if mark != self._shown:
                self._shown = mark
                return state
            if left <= 0.0:
                return None

    def last_seen(self, layer: Layer) -> NDArray[np.int32] | None:
        """See `Source`; None also while a belief lags more than `Static.late`."""
        if layer == "truth":
            return self._truth.last_seen
        if layer not in self._layers:
            return None
        tracker = self._trackers.track(layer, self._now())
        late = tracker.late
        return None if late is None or late > self._late else tracker.fog.last_seen

    def tick(self, layer: Layer) -> int:
        """See `Source`."""
        tick = self._trackers.tick(layer)
        return self._k if tick is None else tick

    def since(self, layer: Layer) -> int:
        """See `Source`; a belief is known as far back as ticks are kept."""
        return self._trackers.since(layer)

    def set_shown(self, layers: Collection[Layer]) -> None:
        """See `Source`."""
        self._trackers.set_shown([layer for layer in layers if layer != "truth"], self._now())

    def trail(self, first: int, last: int) -> NDArray[np.float64] | None:
        """See `Source`; None also when one of these ticks is not kept."""
        end = 0 if self._last is None else self._last.k + 1
        begin = end - len(self._paths)
        if first < begin or last >= end:
            return None
        return np.stack([self._paths[k - begin] for k in range(first, last + 1)])

    def series(self, after: int) -> Series:
        """See `Source`."""
        first = bisect_right(self._ticks, after)
        mfow, mean = (np.array(values[first:], dtype=np.float64) * self._step for values in (self._mfow, self._mean))
        return Series(np.array(self._ticks[first:], dtype=np.int64), mfow, mean)

    def events(self, since: int) -> Sequence[Event]:
        """See `Source`."""
        return self._events[since:]

    def control(self, control: Mapping[str, Any]) -> Answer:
        """See `Source`; the world carries it out."""
        if not self._client.may_control:
            return Answer(False, "this page has no right to control the fleet; start it with the run's control.json")
        try:
            read_control(control)
        except BadInput as bad:
            return Answer(False, str(bad))
        return self._client.control(control)

    def close(self) -> None:
        """See `Source`."""
        self._client.close()

    # --- reading the feed ---------------------------------------------------------------------------------------------

    def _begin(self, so_far: SoFar) -> None:
        """Start, or start again, from the state so far."""
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
            self._apply_control(event)
        # Events keep their numbers. After a gap, those missed are added as far as the world still has them.
        self._events += [_shown(event) for event in _events(so_far.events)[max(self._next_event - so_far.event, 0) :]]
        self._next_event = so_far.event + len(so_far.events)
        side = (len(self._numbers),) * 2
        none = np.zeros(side, np.int64)
        self._links = LinkCounts(none, none.copy(), np.full(side, -1, np.int64), self._since)
        self._heard: dict[int, int] = {}
        self._rates.clear()
        self._log.clear()
        self._logged = 0
        self._paths.clear()
        self._trackers.restart()

    def _read(self, batch: Batch) -> None:
        if batch.first > self._number and not self._request_again():
            return
        for number, packed in enumerate(batch.records, start=batch.first):
            if number == self._number:
                self._number += 1
                self._record(packed)
        if batch.first + len(batch.records) >= self._number:
            if (batch.running, batch.pace) != (self._running, self._pace):
                self._rates.clear()
            self._running, self._pace = batch.running, batch.pace
        self._received_at = self._now()

    def _request_again(self) -> bool:
        """Start again from the fog so far, after a missing batch; False if it was requested only just before."""
        if self._now() < self._requested_at + AGAIN_S:
            return False
        self._requested_at = self._now()
        with suppress(Garbled):
            so_far = read_so_far(self._client.so_far() or b"")
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
                self._apply_control(record)
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
        self._events += self._traps.tick(record, lambda: self._truth.last_seen)
        self._paths.append(places)
        self._ticks.append(k)
        self._mfow.append(record.mfow)
        self._mean.append(record.fog_mean)
        self._count_links(record)
        if not self._rates or self._now() >= self._rates[-1][0] + _SAMPLE_S:
            self._rates.append((self._now(), k))

    def _count_links(self, record: TickRecord) -> None:
        place, links = self._place, self._links
        count_frames(record, place, links.sent, links.delivered)
        for source, to, _ in record.deliveries:
            if source != FORGED:
                links.heard[place[source], place[to]] = record.k
                self._heard[source] = record.k
        here = sum(row.status not in (Status.ABSENT, Status.LEFT) for row in record.robots)
        if self._direct or here == 1:  # only what was sent is known
            self._heard.update({source: record.k for source, _ in record.frames if source != FORGED})

    def _apply_control(self, event: Event) -> None:
        if event.kind == OPERATOR:
            try:
                self._scenario, _ = amended(self._scenario, event.k, read_control(json.loads(event.detail)))
            except (BadInput, ValueError):
                return  # from another version, perhaps; the page then lacks an intruder

    # --- beliefs -----------------------------------------------------------------------------------------------------

    def _tracker(self, layer: Layer) -> FogTracker:
        try:
            key = fleet_key(self._scenario.radio.key)
        except BadInput:
            key = None
        number = layer if isinstance(layer, int) else None
        area = self._ground.patrolled if number is None else self._ground.areas[self._ground.area_of[number]]
        facts = (self._scenario, self._terrain, self._footprint, area, self._ground.patrolled)
        return FogTracker(number, *facts, key, self._log, self._log[0][0] if self._log else self._since)

    def _catch_up(self, limit_s: float) -> None:
        until = self._now() + limit_s
        self._trackers.catch_up(lambda: self._now() >= until)

    # --- showing -----------------------------------------------------------------------------------------------------

    @property
    def _k(self) -> int:
        """The tick of the state."""
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
            gone=self._ended is None and not self._client.present,
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
            trapped=self._traps.trapped(row.number),
        )

    def _rate(self) -> float:
        """Ticks per second of wall time over the last `_RATE_S`; 0 while paused."""
        now = self._now()
        while len(self._rates) > 2 and self._rates[1][0] <= now - _RATE_S:
            self._rates.popleft()
        if self._last is None or not self._rates or not self._running or self._ended is not None:
            return 0.0
        since, before = self._rates[0]
        return (self._last.k - before) / (now - since) if now > since else 0.0

    def _note(self) -> str:
        if self._ended is not None:
            return ""
        if not self._client.present:
            return "the world has disconnected"
        silent_s = self._now() - self._received_at
        return f"no data for {silent_s:.0f} s" if self._running and silent_s > SLOW_S else ""


def _record(packed: bytes) -> object:
    try:
        return unpack(packed)
    except ValueError:
        return None


def _events(packed: Sequence[bytes]) -> list[Event]:
    return [event for one in packed if isinstance(event := _record(one), Event)]


def _shown(event: Event) -> Event:
    """An event with its details as text for operators."""
    return replace(event, detail=described(event)) if event.kind == OPERATOR else event
