"""A run, read from its folder: the journal's ticks as arrays, the scenario, its terrain and the summary.

Robots are in roster order, without the spare ones that never joined. A journal that was cut off, or is still being
written, gives the ticks that it has.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from monitor.replay.run_files import SCENARIO, SUMMARY, journal_in, read_summary
from patrol.changing.ground import Closings
from patrol.energy.batteries import Batteries
from patrol.errors import BadInput
from patrol.journal import Journal, TraceHash
from patrol.journal.records import FORGED, Event, RobotFacts, Status, TickRecord, sent_at
from patrol.pose import Pose
from patrol.prepare import Prepared, prepare, terrain_of
from patrol.scenario import load_scenario
from patrol.scenario.controls import worded
from patrol.summary.model import RobotFigures, Summary
from patrol.summary.totals import RunTotals, count_frames
from runtime.security.private_files import fleet_key

CAME = ("alive", "lost")
"""Events by which a robot joins."""
SILENT = ""
"""The state of a robot that reported none."""

MOST_LABELS = 30_000
"""Different states in one run."""

MOST_CAUSES = 64
"""Different causes of a lost frame besides the scenario's faults."""


@dataclass(frozen=True, eq=False)
class LinkTotals:
    """Frames by directed link, over the whole run; see `patrol.summary.totals`.

    Rows are senders and columns receivers: first the forger, then the roster. With a direct radio `sent` is what the
    world overheard, and all other counts are 0.
    """

    sent: NDArray[np.int64]  # (n + 1, n + 1)
    delivered: NDArray[np.int64]  # (n + 1, n + 1)
    dropped: Mapping[str, NDArray[np.int64]]  # (n + 1, n + 1) by cause
    late: int  # largest delay of a frame, ticks
    delivered_in: NDArray[np.int64]  # (ticks,), between robots, in each tick
    dropped_in: NDArray[np.int64]  # (ticks,), between robots, in each tick

    @property
    def lost(self) -> NDArray[np.int64]:
        """int64 (n + 1, n + 1), frames dropped for any cause."""
        return sum(self.dropped.values(), np.zeros_like(self.delivered))

    def share(self) -> NDArray[np.float64]:
        """float64 (n, n), the delivered share of frames from each robot to each other; NaN where none settled.

        For example, 0.75 for 3 delivered frames and 1 lost one; frames still in flight do not count.
        """
        delivered, lost = self.delivered[1:, 1:], self.lost[1:, 1:]
        sent = delivered + lost
        return np.where(sent > 0, delivered / np.maximum(sent, 1), np.nan).astype(np.float64)


@dataclass(frozen=True, eq=False)
class Run:
    """One run of `n` robots.

    The file of the key that the run's scenario names is never opened, because the folder may come from a stranger.
    """

    folder: Path
    journal: Journal
    prepared: Prepared
    poses: NDArray[np.float64]  # (ticks, n, 3), true x (m), y (m) and heading (rad) at the beginning of each tick
    status: NDArray[np.uint8]  # (ticks, n), `patrol.journal.records.Status`
    bumped: NDArray[np.bool_]  # (ticks, n), a move was cancelled by a collision
    states: NDArray[np.int16]  # (ticks, n), indices of `labels`
    labels: tuple[str, ...]  # the states that minds reported
    goals: NDArray[np.float64]  # (ticks, n, 2), m; NaN without a goal
    decision_ms: NDArray[np.float64]  # (ticks, n), wall time; NaN without a decision
    charge: NDArray[np.float64]  # (ticks, n), share left in the battery after the tick; NaN without one
    mfow: NDArray[np.int64]  # (ticks,), ticks
    fog_mean: NDArray[np.float64]  # (ticks,), ticks
    seen: NDArray[np.int64]  # (ticks,), points seen so far
    links: LinkTotals
    positions: int  # number of frames with the sender's own position, over all ticks
    figures: Summary  # the metrics that the journal's ticks give
    events: tuple[Event, ...]  # all events, in words
    trace: str  # the trace hash of the ticks
    ended: str | None  # how the run ended; None for a journal without an end
    truncated: bool  # the journal ends within a record
    summary: Summary | None  # what summary.json states; None without one
    index: Mapping[int, int] = field(default_factory=dict)  # place of each robot in the arrays, by its number
    key: bytes | None = None  # of the fleet, as given when the run was opened; None without one

    @property
    def ticks(self) -> int:
        """Number of ticks."""
        return len(self.mfow)

    @property
    def step(self) -> float:
        """Duration of a tick, s."""
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

    @cached_property
    def closings(self) -> Closings:
        """The parts of the ground that are closed at each tick."""
        return self.prepared.closings(self.journal.events)

    @property
    def title(self) -> str:
        """The scenario's name."""
        return self.prepared.scenario.name

    @property
    def stated(self) -> Summary:
        """The content of summary.json; nothing is set where there is none."""
        return self.summary or Summary()

    @property
    def direct(self) -> bool:
        """True if robots heard each other directly, so that the journal does not have deliveries."""
        return self.prepared.scenario.radio.via == "direct"

    @property
    def keyless(self) -> bool:
        """True if the fleet tags its messages with a key that is not known here."""
        return self.prepared.scenario.radio.key is not None and self.key is None

    @cached_property
    def robot_figures(self) -> tuple[RobotFigures, ...]:
        """The metrics of the robots, in the order of their places."""
        return tuple(self.figures.robots[name] for name in self.names)

    @property
    def times(self) -> NDArray[np.float64]:
        """float64 (ticks,): when each tick was, s."""
        return np.arange(self.ticks, dtype=np.float64) * self.step

    def alive(self, k: int) -> list[tuple[int, Pose]]:
        """(number, true pose) of the robots that take part in tick k, in roster order."""
        living = np.flatnonzero(self.status[k] == Status.ALIVE).tolist()
        return [(self.numbers[index], Pose(*self.poses[k, index].tolist())) for index in living]


def open_run(folder: Path, key: Path | None = None) -> Run:
    """Read a run from a folder that may come from a stranger.

    No file outside of it is opened, except that of the fleet's key; without a key the tags of messages stay unchecked.
    """
    journal = journal_in(folder)
    secret = fleet_key(key)
    summary = read_summary(folder / SUMMARY)
    prepared = prepared_in(folder, journal).as_operated(journal.events)
    return read_run(folder, journal, prepared, summary, secret)


def prepared_in(folder: Path, journal: Journal) -> Prepared:
    """Prepare the scenario in a run's folder, without the operators' additions.

    The folder may come from a stranger, so no file outside of it is opened.
    """
    scenario = load_scenario(folder / SCENARIO, opens_classes=False)
    if [robot.number for robot in journal.header.robots] != [spec.number for spec in scenario.roster]:
        raise BadInput(
            f"{folder}: the journal has other robots than {SCENARIO}; they belong to different runs: restore its own"
        )
    terrain = terrain_of(scenario, folder)
    facts = journal.header.terrain
    if (facts.width, facts.height) != (terrain.width, terrain.height):
        raise BadInput(
            f"{folder}: the journal's terrain has {facts.width} x {facts.height} points and that of {SCENARIO} "
            f"{terrain.width} x {terrain.height}; they belong to different runs: restore the run's own {SCENARIO}"
        )
    return prepare(scenario, terrain)


def read_run(
    folder: Path, journal: Journal, prepared: Prepared, summary: Summary | None = None, key: bytes | None = None
) -> Run:
    """Read a journal's ticks into arrays."""
    came = {event.robot for event in journal.events if event.kind in CAME}
    absent = {number for number in prepared.scenario.spares if number not in came}
    robots = [robot for robot in journal.header.robots if robot.number not in absent]
    index = {robot.number: column for column, robot in enumerate(robots)}
    scenario = prepared.scenario
    numbers = [robot.number for robot in journal.header.robots]
    rows = _Rows(
        index, numbers, Batteries(scenario.roster, scenario.docks, scenario.step), MOST_CAUSES + len(scenario.faults)
    )
    totals = RunTotals(journal.header, scenario.step, int(np.count_nonzero(prepared.patrolled)))
    trace = TraceHash(scenario.spares)
    for record in journal.ticks:
        trace.tick(record)
        try:
            rows.take(record)
            totals.tick(record)
        except _Unfit as unfit:
            raise BadInput(f"{journal.path}: tick {len(rows.mfow)}: {unfit}; restore the run's own journal") from None
    if any(event.k > scenario.ticks for event in journal.events):
        raise BadInput(f"{journal.path}: has an event after the last tick of the scenario; restore the run's own")
    if not rows.mfow:
        raise BadInput(f"{journal.path}: holds no complete tick; wait until the run has one, or run it again")
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
        charge=rows.charges(),
        mfow=np.array(rows.mfow, dtype=np.int64),
        fog_mean=np.array(rows.fog_mean, dtype=np.float64),
        seen=np.array(rows.seen, dtype=np.int64),
        links=rows.links(),
        positions=rows.positions,
        figures=totals.figures(journal.events),
        events=tuple(map(worded, journal.events)),
        trace=trace.hexdigest(),
        ended=None if journal.end is None else journal.end.reason,
        truncated=journal.truncated,
        summary=summary,
        index=index,
        key=key,
    )


class _Unfit(Exception):
    """A tick that does not fit to the ticks before it, or to the journal's header."""


class _Rows:
    """Collects the values of tick records."""

    def __init__(
        self, index: Mapping[int, int], numbers: Sequence[int], batteries: Batteries, most_causes: int
    ) -> None:
        self._batteries = batteries
        self._index = index
        self._numbers = numbers
        self._most_causes = most_causes
        self.poses: list[list[tuple[float, float, float]]] = []
        self.status: list[list[int]] = []
        self.bumped: list[list[bool]] = []
        self.states: list[list[int]] = []
        self.labels: dict[str, int] = {SILENT: 0}
        self.goals: list[list[tuple[float, float]]] = []
        self.decision_ms: list[list[float]] = []
        self._charge: list[list[float]] = []
        self.mfow: list[int] = []
        self.fog_mean: list[float] = []
        self.seen: list[int] = []
        self.positions = 0
        self._delivered_in: list[int] = []
        self._dropped_in: list[int] = []
        self._place = {FORGED: 0, **{number: column + 1 for number, column in index.items()}}
        side = len(index) + 1
        self._sent, self._delivered = np.zeros((2, side, side), dtype=np.int64)
        self._dropped: dict[str, NDArray[np.int64]] = {}
        self._late = 0

    def take(self, record: TickRecord) -> None:
        if record.k != len(self.mfow):
            raise _Unfit(f"its record is of tick {record.k}")
        if [robot.number for robot in record.robots] != self._numbers:
            raise _Unfit("it has other robots than the journal's header")
        robots, nan = [robot for robot in record.robots if robot.number in self._index], float("nan")
        self.poses.append([(robot.x, robot.y, robot.heading) for robot in robots])
        self.status.append([int(robot.status) for robot in robots])
        self.bumped.append([robot.bumped for robot in robots])
        self.states.append([self.labels.setdefault(robot.state, len(self.labels)) for robot in robots])
        self.goals.append([robot.goal or (nan, nan) for robot in robots])
        self.decision_ms.append([nan if robot.decision_ms is None else robot.decision_ms for robot in robots])
        if self._batteries.numbers:
            self._batteries.tick(record.robots)
            shares = self._batteries.shares
            self._charge.append([shares.get(robot.number, nan) for robot in robots])
        # The arrays hold states as int16.
        if len(self.labels) > MOST_LABELS:
            raise _Unfit(f"robots reported more than {MOST_LABELS} states")
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
            self._count_loss(source, destination, cause)

    def _count_loss(self, source: int, destination: int, cause: str) -> None:
        if source not in self._place or destination not in self._place:
            raise _Unfit(f"a frame from robot {source} to robot {destination} was dropped, which do not take part")
        if cause not in self._dropped:
            # Each cause takes a matrix of all links, so a stranger's journal could fill the memory.
            if len(self._dropped) >= self._most_causes:
                raise _Unfit(f"frames were dropped for more than {self._most_causes} causes")
            self._dropped[cause] = np.zeros_like(self._delivered)
        self._dropped[cause][self._place[source], self._place[destination]] += 1

    def charges(self) -> NDArray[np.float64]:
        """Return the shares left in batteries, by tick and robot; one NaN stands for all without batteries."""
        if not self._batteries.numbers:
            return np.broadcast_to(np.float64("nan"), (len(self.mfow), len(self._index)))
        return np.array(self._charge, dtype=np.float64)

    def links(self) -> LinkTotals:
        delivered_in = np.array(self._delivered_in, dtype=np.int64)
        dropped_in = np.array(self._dropped_in, dtype=np.int64)
        dropped = dict(sorted(self._dropped.items()))
        return LinkTotals(self._sent, self._delivered, dropped, self._late, delivered_in, dropped_in)
