"""The source for a running fleet with a world: its feed gives the true fog, and from it follow the robots' beliefs.

The journal's records arrive in batches (`runtime.messages.feed`). At the start, and whenever a batch is missing, the
source requests the fog so far from the world. Only the true fog is always up to date. The fogs that follow from heard
positions are computed on demand from the ticks kept in memory.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from monitor.live.fog_tracker import HEARD, FogTracker, FogTrackers
from monitor.live.record_checks import RunChecks, record_of, scenario_of
from monitor.observation.link_counts import LiveLinks
from monitor.observation.listener import NO_ROBOT, Listener, mark_outside
from monitor.observation.source import (
    Answer,
    Layer,
    RobotShape,
    RobotState,
    Series,
    SeriesLog,
    Source,
    State,
    Static,
    TickRate,
)
from monitor.observation.traps import TrapWatch
from patrol.changing.ground import Closings
from patrol.energy.batteries import Batteries
from patrol.errors import BadInput, Malformed
from patrol.ground.fog import Fog
from patrol.ground.terrain import Terrain
from patrol.journal.records import End, Event, Header, Status, TickRecord
from patrol.pose import Pose
from patrol.prepare import closable_ground, inboxes_of, prepare, sensor_footprint
from patrol.radio.message import as_received
from patrol.scenario.controls import (
    CONTROLS,
    OPERATOR,
    amended,
    control_in,
    in_force,
    intruders_there,
    read_control,
    worded,
)
from patrol.scenario.marks import looks_at
from runtime.messages.feed import Batch, SoFar, read_so_far

if TYPE_CHECKING:
    from monitor.live.feed_client import FeedClient

SLICE_S = 0.05
"""Wall time for computing beliefs between two batches, s."""
SLOW_S = 3.0
"""Wall time without data after which the page says so, s."""
AGAIN_S = 5.0
"""Least wall time between two requests for the fog so far, s."""
LATE_S, LATE_TICKS = 5.0, 20
"""Largest lag of a belief that is still shown: in simulated time (s) or in ticks, whichever is more."""
REMEMBERED = 48 << 20
"""Bytes of the ticks that are kept for beliefs."""
PATHS = 256
"""Ticks whose positions are kept for trails."""
BATCHES = 4096
"""Most batches to process between two states."""
MOST_EVENTS = 1 << 18
"""Events that are kept."""
REFUSED_S = 10.0
"""Time for which a page says that records of the feed were refused, s."""


class FeedSource(Source):
    """A `monitor.observation.source.Source` that reads the feed of a world."""

    def __init__(
        self,
        name: str,
        client: FeedClient,
        so_far: SoFar,
        now: Callable[[], float] = time.monotonic,
        key: bytes | None = None,
    ) -> None:
        """Start from the state so far.

        `key` is for the tags of frames; None where this viewer has none. A file that the feed names is never opened,
        except that of a sensor which this user runs.
        """
        header = record_of(so_far.header)
        scenario = scenario_of(header, *so_far.last_seen.shape) if isinstance(header, Header) else None
        if not isinstance(header, Header) or scenario is None or set(so_far.ground.area_of) != set(scenario.numbers):
            raise BadInput(f"--fleet {name}: its world runs another version; use one version on all hosts")
        self._name = name
        self._key = key
        self._client = client
        self._now = now
        self._header = header
        self._ground = so_far.ground
        self._first = so_far
        self._given = self._scenario = scenario
        facts = header.terrain
        self._terrain = Terrain(facts.name, so_far.ground.passable, facts.point, facts.origin, so_far.ground.keep_out)
        self._footprint = sensor_footprint(scenario, self._terrain)
        self._closings = Closings(closable_ground(scenario, self._terrain), self._terrain)
        self._step = scenario.step
        self._late = max(LATE_TICKS, round(LATE_S / self._step))
        self._numbers = scenario.numbers
        self._checks = RunChecks.of(scenario, self._terrain.bounds)
        self._refused_at = -math.inf
        self._end: End | None = None
        self._place = {number: index for index, number in enumerate(self._numbers)}
        self._events: list[Event] = []
        self._next_event = 0
        # With a direct radio the journal has the frames that the world overheard; those that robots heard are unknown.
        self._direct = scenario.radio.via == "direct"
        self._layers: tuple[Layer, ...] = ("truth", HEARD, *(() if self._direct else self._numbers))
        self._trackers = FogTrackers(self._make_tracker)
        self._traps = TrapWatch(prepare(scenario, self._terrain))
        self._log: deque[tuple[int, bytes]] = deque()
        self._logged = 0
        self._last: TickRecord | None = None
        self._rate = TickRate()
        self._paths: deque[NDArray[np.float64]] = deque(maxlen=PATHS)
        self._requested_at = now()
        self._received_at = now()
        self._shown: tuple[object, ...] = ()
        try:
            self._begin_state(so_far)
        except Malformed as malformed:
            raise BadInput(f"--fleet {name}: its world sent {malformed}; use one version on all hosts") from None

    # --- Source ------------------------------------------------------------------------------------------------------

    def static(self) -> Static:
        """See `Source`."""
        return Static(
            name=self._name,
            scenario=self._header.scenario,
            terrain=self._terrain,
            patrolled=self._ground.patrolled,
            robots=RobotShape.all_of(self._given),
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
            remaining_s = until - self._now()
            batch = self._client.batch(0.0 if self._trackers.behind else max(0.0, remaining_s))
            for _ in range(BATCHES):
                if batch is None:
                    break
                self._read_batch(batch)
                batch = self._client.batch(0.0)
            self._catch_up(min(SLICE_S, max(remaining_s, 0.01)))
            self._trackers.drop(self._now())
            state = self._make_state()
            mark = (state.k, state.running, state.pace, state.ended, state.note, len(self._events))
            if mark != self._shown:
                self._shown = mark
                return state
            if remaining_s <= 0.0:
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
        return self._series.after(after)

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

    def _begin_state(self, so_far: SoFar) -> None:
        """Start, or start again, from the state so far."""
        batteries = Batteries(self._given.roster, self._given.docks, self._given.step)
        if so_far.charge.keys() != set(batteries.numbers):
            raise Malformed("the charge of other robots than have batteries")
        self._batteries = batteries
        self._number = so_far.number
        self._lost = False
        self._running, self._pace = so_far.running, so_far.pace
        self._truth = Fog.resumed(self._ground.patrolled, so_far.last_seen)
        last = None if so_far.last is None else record_of(so_far.last, self._checks.longest)
        self._last = last if isinstance(last, TickRecord) and self._checks.tick(last) else None
        self._end = None
        self._batteries.resume(so_far.charge, () if self._last is None else self._last.robots)
        ticks = range(0, len(so_far.mfow) * so_far.every, so_far.every)
        self._series = SeriesLog(self._step, ticks, so_far.mfow.tolist(), so_far.fog_mean.tolist())
        self._since = 0 if self._last is None else self._last.k + 1
        self._scenario = self._given
        events = sorted(self._checks.events(so_far.asked), key=lambda event: event.k)
        self._closings = Closings(self._closings.now.points, self._terrain, events)
        for event in events:
            self._apply_control(event)
        # Events keep their numbers. After a gap, those missed are added as far as the world still has them.
        missed = so_far.events[max(self._next_event - so_far.event, 0) :]
        self._add_events(map(worded, self._checks.events(missed)))
        self._next_event = so_far.event + len(so_far.events)
        self._links = LiveLinks(self._numbers, self._since, direct=self._direct)
        self._rate.clear()
        self._log.clear()
        self._logged = 0
        self._paths.clear()
        self._trackers.restart()

    def _read_batch(self, batch: Batch) -> None:
        if (batch.first > self._number or self._lost) and not self._request_again():
            return
        for number, packed in enumerate(batch.records, start=batch.first):
            if number == self._number:
                if not self._take_record(packed):
                    self._refused_at = self._now()
                    self._lost = True
                    return
                self._number += 1
        if batch.first + len(batch.records) >= self._number:
            if (batch.running, batch.pace) != (self._running, self._pace):
                self._rate.clear()
            self._running, self._pace = batch.running, batch.pace
        self._received_at = self._now()

    def _request_again(self) -> bool:
        """Start again from the fog so far, after a missing batch; False if it was requested only just before."""
        if self._now() < self._requested_at + AGAIN_S:
            return False
        self._requested_at = self._now()
        for payload in self._client.so_far():
            with suppress(Malformed):
                self._begin_state(read_so_far(payload, self._first))
                return True
        return False

    def _take_record(self, packed: bytes) -> bool:
        """Take in the next record; False for one that cannot be the next of this run."""
        record = self._checks.record(packed, self._next_tick)
        if record is None or self._end is not None:
            return False
        match record:
            case TickRecord():
                self._take_tick(record)
                self._log.append((record.k, packed))
                self._logged += len(packed)
                while self._logged > REMEMBERED:
                    self._logged -= len(self._log.popleft()[1])
            case Event():
                self._apply_control(record)
                self._closings.take([record])
                self._add_events([worded(record)])
                self._next_event += 1
            case End():
                self._end = record
        return True

    def _add_events(self, events: Iterable[Event]) -> None:
        """Add events, up to `MOST_EVENTS`: beyond them, they are those of a stranger."""
        self._events += islice(events, max(MOST_EVENTS - len(self._events), 0))

    def _take_tick(self, record: TickRecord) -> None:
        k = record.k
        places = np.full((len(self._numbers), 2), np.nan)
        self._closings.show(k, self._footprint)
        for row in record.robots:
            if row.status.is_present:
                places[self._place[row.number]] = row.x, row.y
            if row.status is Status.ALIVE:
                pose = as_received(Pose(row.x, row.y, row.heading))
                self._truth.observe(self._footprint.visible(pose), k)
        self._last = record
        self._batteries.tick(record.robots)
        self._add_events(self._traps.tick(record, lambda: self._truth.last_seen, self._closings))
        self._paths.append(places)
        self._series.add(k, record.mfow, record.fog_mean)
        self._links.tick(record)
        self._rate.add(self._now(), k)

    def _apply_control(self, event: Event) -> None:
        if event.kind == OPERATOR:
            try:
                self._scenario, _ = amended(self._scenario, event.k, control_in(event))
            except BadInput:
                return  # from another version, perhaps; the page then lacks an intruder

    # --- beliefs -----------------------------------------------------------------------------------------------------

    def _make_tracker(self, layer: Layer) -> FogTracker:
        ground, scenario, closings = self._ground, self._scenario, self._closings
        area = ground.areas[ground.area_of[layer]] if isinstance(layer, int) else ground.patrolled

        def listener(number: int) -> Listener:
            inboxes = inboxes_of(scenario, [number], self._terrain.bounds, self._key)
            new_listener = Listener(self._footprint, area, inboxes, number, closings)
            mark_outside(new_listener.fog, ground.patrolled)
            return new_listener

        since = self._log[0][0] if self._log else self._since
        return FogTracker(layer if isinstance(layer, int) else NO_ROBOT, listener, self._log, since)

    def _catch_up(self, limit_s: float) -> None:
        until = self._now() + limit_s
        self._trackers.catch_up(lambda: self._now() >= until)

    # --- showing -----------------------------------------------------------------------------------------------------

    @property
    def _k(self) -> int:
        """The tick of the state."""
        return 0 if self._last is None else self._last.k

    @property
    def _next_tick(self) -> int:
        """The tick that must come next."""
        return 0 if self._last is None else self._last.k + 1

    @property
    def _end_reason(self) -> str | None:
        """The reason why the run has ended; None as long as its world is there, since any sender may claim an end."""
        return None if self._end is None or self._client.present else self._end.reason

    def _make_state(self) -> State:
        last = self._last
        k, coming = self._k, self._next_tick
        running = self._running and self._end_reason is None
        return State(
            k=k,
            time_s=k * self._step,
            running=running,
            pace=self._pace,
            ticks_per_s=self._rate.at(self._now(), k) if running and last is not None else 0.0,
            robots=() if last is None else tuple(self._robot_state(last, index) for index in range(len(self._numbers))),
            mfow_s=None if last is None else last.mfow * self._step,
            fog_mean_s=None if last is None else last.fog_mean * self._step,
            links=None if self._direct else self._links.counts,
            ended=self._end_reason,
            intruders=intruders_there(self._scenario, k),
            looks=looks_at(self._scenario, coming, self._closings),
            faults=in_force(self._scenario, coming, len(self._given.faults)),
            note=self._silence_note(),
            gone=self._end_reason is None and not self._client.present,
        )

    def _robot_state(self, last: TickRecord, place: int) -> RobotState:
        row = last.robots[place]
        heard_tick = self._links.heard.get(row.number)
        return RobotState(
            number=row.number,
            status=row.status,
            state=row.state,
            pose=Pose(row.x, row.y, row.heading) if row.status.is_present else None,
            goal=row.goal,
            decision_ms=row.decision_ms,
            heard_s=None if heard_tick is None else (last.k - heard_tick) * self._step,
            trapped=self._traps.trapped(row.number),
            charge=self._batteries.share(row.number),
        )

    def _silence_note(self) -> str:
        if self._end_reason is not None:
            return ""
        if not self._client.present:
            return "the world has disconnected"
        if self._now() < self._refused_at + REFUSED_S:
            return "the feed has records that make no sense, perhaps from a stranger; they are ignored"
        silent_s = self._now() - self._received_at
        if waits := self._client.waits:
            return waits
        return f"no data for {silent_s:.0f} s" if self._running and silent_s > SLOW_S else ""
