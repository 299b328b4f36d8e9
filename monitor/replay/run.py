"""A run as its folder tells it: the journal's ticks as arrays, next to the scenario, its terrain and the summary.

Everything is in roster order, without the spare robots that never came. A journal that was cut off, or one that is
still being written, gives what is in it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monitor.observation.frames import count_frames
from monitor.replay.run_files import SCENARIO, SUMMARY, journal_in
from patrol.errors import BadInput
from patrol.journal import Journal
from patrol.journal.records import DEAD_END, FORGED, Event, RobotFacts, Status, TickRecord, sent_at, standing_after
from patrol.pose import Pose
from patrol.prepare import Prepared, prepare
from patrol.scenario import load_scenario
from patrol.scenario.controls import prepared_as_operated

CAME = ("alive", "lost")
"""Events by which a robot that was not there is."""
SILENT = ""
"""The state of a robot that did not report one."""


@dataclass(frozen=True, eq=False)
class LinkTotals:
    """What became of frames, by directed link: index 0 is who forges, then the roster; see `monitor.observation.frames`.

    sent, delivered: int64 (n + 1, n + 1), source by destination. dropped: the same by cause. late: the most ticks that
    a frame took. delivered_in, dropped_in: int64 (ticks,), over all links between robots. Of a direct radio sent is
    what the world overheard, and all else is nothing.
    """

    sent: NDArray[np.int64]
    delivered: NDArray[np.int64]
    dropped: Mapping[str, NDArray[np.int64]]
    late: int
    delivered_in: NDArray[np.int64]
    dropped_in: NDArray[np.int64]

    @property
    def lost(self) -> NDArray[np.int64]:
        """int64 (n + 1, n + 1): dropped for any cause."""
        return sum(self.dropped.values(), np.zeros_like(self.delivered))

    def share(self) -> NDArray[np.float64]:
        """float64 (n, n): the delivered share of what each robot sent each other one; NaN where nothing was sent."""
        delivered, lost = self.delivered[1:, 1:], self.lost[1:, 1:]
        sent = delivered + lost
        return np.where(sent > 0, delivered / np.maximum(sent, 1), np.nan).astype(np.float64)


@dataclass(frozen=True, eq=False)
class Run:
    """One run.

    poses: float64 (ticks, n, 3), true ones at the beginning of each tick. status: uint8 (ticks, n). bumped: bool
    (ticks, n). states: int16 (ticks, n), indices of `labels`. goals: float64 (ticks, n, 2), m, NaN without one.
    decision_ms: float64 (ticks, n), NaN without one. driven: float64 (n,), m, along the commands obeyed. mfow: int64
    (ticks,); fog_mean: float64 (ticks,); both in ticks. seen: int64 (ticks,), points seen so far. positions: frames
    that carry the sender's own position, over all ticks. rejected: frames that robots say they refused. standing: uint8
    (n,), how each robot was left, after what happened past the last tick. summary: of summary.json, None where there is
    none.
    """

    folder: Path
    journal: Journal
    prepared: Prepared
    poses: NDArray[np.float64]
    status: NDArray[np.uint8]
    bumped: NDArray[np.bool_]
    states: NDArray[np.int16]
    labels: tuple[str, ...]
    goals: NDArray[np.float64]
    decision_ms: NDArray[np.float64]
    driven: NDArray[np.float64]
    mfow: NDArray[np.int64]
    fog_mean: NDArray[np.float64]
    seen: NDArray[np.int64]
    links: LinkTotals
    positions: int
    rejected: int
    standing: NDArray[np.uint8]
    events: tuple[Event, ...]
    ended: str | None
    truncated: bool
    summary: Mapping[str, Any] | None
    index: Mapping[int, int] = field(default_factory=dict)
    """A robot's place among those of the run, by its number: all of the roster but spare ones that never came."""

    @property
    def ticks(self) -> int:
        """How many there are."""
        return len(self.mfow)

    @property
    def step(self) -> float:
        """Seconds of a tick."""
        return self.prepared.scenario.step

    @cached_property
    def robots(self) -> tuple[RobotFacts, ...]:
        """The robots in the order of their places."""
        return tuple(robot for robot in self.journal.header.robots if robot.number in self.index)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The robots' names."""
        return tuple(robot.name for robot in self.robots)

    @cached_property
    def numbers(self) -> tuple[int, ...]:
        """The robots' numbers."""
        return tuple(robot.number for robot in self.robots)

    @property
    def title(self) -> str:
        """The scenario's name."""
        return self.prepared.scenario.name

    @property
    def direct(self) -> bool:
        """Whether robots heard each other directly, so that the journal does not have the fate of their frames."""
        return self.prepared.scenario.radio.via == "direct"

    @property
    def dead_end_share(self) -> NDArray[np.float64]:
        """float64 (n,): the share of its decisions in which each robot was getting out of a dead end; 0 without any."""
        decided = ~np.isnan(self.decision_ms)
        stuck = np.array([label == DEAD_END for label in self.labels])[self.states] & decided
        share: NDArray[np.float64] = stuck.sum(axis=0) / np.maximum(decided.sum(axis=0), 1)
        return share

    @property
    def times(self) -> NDArray[np.float64]:
        """float64 (ticks,): when each tick was, s."""
        return np.arange(self.ticks, dtype=np.float64) * self.step

    def alive(self, k: int) -> list[tuple[int, Pose]]:
        """(number, true pose) of the robots that take part in tick k, in roster order."""
        living = np.flatnonzero(self.status[k] == Status.ALIVE).tolist()
        return [(self.numbers[place], Pose(*self.poses[k, place].tolist())) for place in living]


def open_run(folder: Path) -> Run:
    """Read a run folder; BadInput where that is not possible, or where no tick is done yet."""
    journal = journal_in(folder)
    prepared = prepared_as_operated(prepare(load_scenario(folder / SCENARIO)), journal.events)
    facts, terrain = journal.header.terrain, prepared.terrain
    if (facts.width, facts.height) != (terrain.width, terrain.height):
        raise BadInput(
            f"{folder}: the journal's terrain has {facts.width} x {facts.height} points and that of {SCENARIO} "
            f"{terrain.width} x {terrain.height}; they are not of one run"
        )
    if [robot.number for robot in journal.header.robots] != [spec.number for spec in prepared.scenario.roster]:
        raise BadInput(f"{folder}: the journal has other robots than {SCENARIO}; they are not of one run")
    return read_run(folder, journal, prepared, _summary(folder / SUMMARY))


def read_run(folder: Path, journal: Journal, prepared: Prepared, summary: Mapping[str, Any] | None = None) -> Run:
    """A journal's ticks as arrays; BadInput when it holds none."""
    came = {event.robot for event in journal.events if event.kind in CAME}
    robots = [one for one in journal.header.robots if one.number not in prepared.scenario.spares or one.number in came]
    index = {robot.number: place for place, robot in enumerate(robots)}
    cars = {robot.number for robot in journal.header.robots if robot.model == "car"}
    rows = _Rows(index, cars, prepared.scenario.step)
    for record in journal.ticks:
        rows.take(record)
    if not rows.mfow:
        raise BadInput(f"{journal.path}: holds no whole tick, so nothing can be shown; wait for one, or run it again")
    return Run(
        folder=folder,
        journal=journal,
        prepared=prepared,
        poses=np.array(rows.poses, dtype=np.float64),
        status=np.array(rows.status, dtype=np.uint8),
        bumped=np.array(rows.bumped, dtype=np.bool_),
        states=np.array(rows.states, dtype=np.int16),
        labels=tuple(rows.labels),
        goals=np.array(rows.goals, dtype=np.float64),
        decision_ms=np.array(rows.decision_ms, dtype=np.float64),
        driven=np.array([rows.driven[number] for number in index], dtype=np.float64),
        mfow=np.array(rows.mfow, dtype=np.int64),
        fog_mean=np.array(rows.fog_mean, dtype=np.float64),
        seen=np.array(rows.seen, dtype=np.int64),
        links=rows.links(),
        positions=rows.positions,
        rejected=rows.rejected,
        standing=_standing(rows.status, index, journal.events),
        events=journal.events,
        ended=None if journal.end is None else journal.end.reason,
        truncated=journal.truncated,
        summary=summary,
        index=index,
    )


class _Rows:
    """What is collected from tick records, one by one."""

    def __init__(self, index: Mapping[int, int], cars: Collection[int], step: float) -> None:
        self._index = index
        self._cars = cars
        self._step = step
        self.driven = dict.fromkeys(index, 0.0)
        self.poses: list[list[tuple[float, float, float]]] = []
        self.status: list[list[int]] = []
        self.bumped: list[list[bool]] = []
        self.states: list[list[int]] = []
        self.labels: dict[str, int] = {SILENT: 0}
        self.goals: list[list[tuple[float, float]]] = []
        self.decision_ms: list[list[float]] = []
        self.mfow: list[int] = []
        self.fog_mean: list[float] = []
        self.seen: list[int] = []
        self.positions = 0
        self.rejected = 0
        self._counted: dict[int, int] = {}
        self._delivered_in: list[int] = []
        self._dropped_in: list[int] = []
        self._place = {FORGED: 0, **{number: place + 1 for number, place in index.items()}}
        side = len(index) + 1
        self._sent = np.zeros((side, side), dtype=np.int64)
        self._delivered = np.zeros((side, side), dtype=np.int64)
        self._dropped: dict[str, NDArray[np.int64]] = {}
        self._late = 0

    def take(self, record: TickRecord) -> None:
        robots, nan = [robot for robot in record.robots if robot.number in self._index], float("nan")
        self.poses.append([(robot.x, robot.y, robot.heading) for robot in robots])
        self.status.append([int(robot.status) for robot in robots])
        self.bumped.append([robot.bumped for robot in robots])
        self.states.append([self.labels.setdefault(robot.state, len(self.labels)) for robot in robots])
        self.goals.append([robot.goal or (nan, nan) for robot in robots])
        self.decision_ms.append([nan if robot.decision_ms is None else robot.decision_ms for robot in robots])
        for robot in robots:
            if not robot.bumped:
                speed = abs(robot.c0) if robot.number in self._cars else math.hypot(robot.c0, robot.c1)
                self.driven[robot.number] += speed * self._step
        for robot in robots:
            if robot.rejected is not None:
                # A mind that is started anew counts from 0 again.
                new = robot.rejected - self._counted.get(robot.number, 0)
                self.rejected += new if new >= 0 else robot.rejected
                self._counted[robot.number] = robot.rejected
        self.mfow.append(record.mfow)
        self.fog_mean.append(record.fog_mean)
        self.seen.append(record.seen)
        self.positions += len({source for source, _ in record.frames if source in self._index})
        self._delivered_in.append(sum(source in self._index for source, _, _ in record.deliveries))
        self._dropped_in.append(sum(source in self._index for source, _, _, _ in record.dropped))
        count_frames(record, self._place, self._sent, self._delivered)
        if record.deliveries:
            earliest = min(sent_at(sequence) for _, _, sequence in record.deliveries)
            self._late = max(self._late, record.k - earliest)
        for source, destination, _, cause in record.dropped:
            if cause not in self._dropped:
                self._dropped[cause] = np.zeros_like(self._delivered)
            self._dropped[cause][self._place[source], self._place[destination]] += 1

    def links(self) -> LinkTotals:
        delivered_in = np.array(self._delivered_in, dtype=np.int64)
        dropped_in = np.array(self._dropped_in, dtype=np.int64)
        dropped = dict(sorted(self._dropped.items()))
        return LinkTotals(self._sent, self._delivered, dropped, self._late, delivered_in, dropped_in)


def _standing(status: Sequence[Sequence[int]], index: Mapping[int, int], events: Sequence[Event]) -> NDArray[np.uint8]:
    """Each robot's standing at the end, with what befell it after the last tick, as the summary has it."""
    standing = np.array(status[-1], dtype=np.uint8)
    for event in events:
        place, left = index.get(event.robot or 0), standing_after(event.kind)
        if event.k >= len(status) and place is not None and left is not None:
            standing[place] = left
    return standing


def _summary(path: Path) -> Mapping[str, Any] | None:
    """summary.json, if it is there and whole; a run that was killed has none."""
    try:
        says = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return says if isinstance(says, dict) else None
