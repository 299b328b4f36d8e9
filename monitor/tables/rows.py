"""The rows of a run's tables, in one pass over its journal and, for the ground, one replay."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from monitor.replay.replay import VisitCounter, Watcher, play
from monitor.tables.columns import EVENTS, FORGER, GROUND, LINKS, ROBOTS, TICKS, VISITS
from patrol.journal.links import drops_of
from patrol.journal.records import FORGED, Status
from patrol.measures.nodes import node_totals
from patrol.pose import Drive, Twist, Velocity, command_of
from patrol.summary.totals import count_frames

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from monitor.replay.run import Run
    from patrol.ground.fog import Fog
    from patrol.journal.records import RobotTick, TickRecord

Row = tuple[object, ...]
"""A value for each column of a table, in their order."""


RowsOf = Callable[["TickRecord"], "list[Row]"]
"""Gives a tick's rows of a table; it is called for each tick in turn."""


def _tick_rows(run: Run) -> RowsOf:
    patrolled, links = int(np.count_nonzero(run.prepared.patrolled)), _Links(run)

    def rows_of(record: TickRecord) -> list[Row]:
        standing = Counter(row.status for row in record.robots)
        row = (
            record.k,
            record.k * run.step,
            record.mfow * run.step,
            record.fog_mean * run.step,
            record.seen / patrolled,
            standing[Status.ALIVE],
            standing[Status.PAUSED],
            standing[Status.DEAD],
            standing[Status.LOST],
            standing[Status.ABSENT] + standing[Status.LEFT],
            sum(row.bumped for row in record.robots),
            *links.totals(record),
        )
        return [row]

    return rows_of


def _robot_rows(run: Run) -> RowsOf:
    robots = {robot.number: robot for robot in run.robots}
    reported = dict.fromkeys(robots, 0)

    def newly_rejected(row: RobotTick) -> int:
        """Return the frames refused since the last report; a robot that was started again counts from zero."""
        if row.rejected is None:
            return 0
        before, reported[row.number] = reported[row.number], row.rejected
        return row.rejected - before if row.rejected >= before else row.rejected

    def rows_of(record: TickRecord) -> list[Row]:
        charge = run.charge[record.k].tolist()
        frames: Counter[int] = Counter()
        sizes: Counter[int] = Counter()
        for source, frame in record.frames:
            frames[source] += 1
            sizes[source] += len(frame)
        return [
            (
                record.k,
                record.k * run.step,
                robots[row.number].name,
                row.status.name.lower(),
                row.x,
                row.y,
                row.heading,
                *_command_columns(robots[row.number].model, row, run.step),
                row.bumped,
                row.refused,
                row.state or None,
                *(row.goal or (None, None)),
                row.decision_ms,
                frames[row.number],
                sizes[row.number],
                newly_rejected(row),
                None if np.isnan(share := charge[run.index[row.number]]) else share,
            )
            for row in record.robots
            if row.number in robots
        ]

    return rows_of


def _command_columns(model: str, row: RobotTick, step: float) -> Row:
    """Return velocity along x and y, speed, turn rate, curvature, and the way that was driven."""
    command = command_of(model, row.c0, row.c1)
    driven_m = 0.0 if row.bumped else command.speed_mps * step
    if isinstance(command, Velocity):
        return (row.c0, row.c1, None, None, None, driven_m)
    if isinstance(command, Twist):
        return (None, None, row.c0, row.c1, None, driven_m)
    assert isinstance(command, Drive)
    return (None, None, row.c0, None, row.c1, driven_m)


_NONE_LOST: Counter[str | None] = Counter({None: 0})


class _Links:
    """Counts the frames of a tick by link.

    Rows are senders and columns receivers, first the forger, then the robots. Where robots heard each other directly,
    only what was sent is known.
    """

    def __init__(self, run: Run) -> None:
        self._direct = run.direct
        self._place = {FORGED: 0, **{number: column + 1 for number, column in run.index.items()}}

    def totals(self, record: TickRecord) -> tuple[int, int | None, int | None]:
        """Return robots' frames sent, delivered and dropped; None where unknown."""
        sent, delivered = (int(counts[1:].sum()) for counts in self._count_record(record))
        if self._direct:
            return sent, None, None
        return sent, delivered, int(np.count_nonzero(drops_of(record.dropped).source != FORGED))

    def links(self, record: TickRecord) -> Iterator[tuple[int, int, int, int | None, int | None, str | None]]:
        """Yield sender, receiver (places), sent, delivered, dropped and cause; a further row for each further cause."""
        sent_frames, delivered_frames = self._count_record(record)
        causes: dict[tuple[int, int], Counter[str | None]] = {}
        for source, to, _, cause in record.dropped:
            causes.setdefault((self._place[source], self._place[to]), Counter())[cause] += 1
        used = (sent_frames + delivered_frames) > 0
        for link in sorted({(sender, receiver) for sender, receiver in np.argwhere(used).tolist()} | causes.keys()):
            sent, delivered = int(sent_frames[link]), int(delivered_frames[link])
            if self._direct:
                yield *link, sent, None, None, None
                continue
            lost = causes.get(link, _NONE_LOST)
            for why in sorted(lost, key=str):
                yield *link, sent, delivered, lost[why], why
                sent = delivered = 0  # so that sums over rows count each frame once

    def _count_record(self, record: TickRecord) -> NDArray[np.int64]:
        """Return the frames sent and those delivered, int64 (2, n + 1, n + 1)."""
        counts = np.zeros((2, len(self._place), len(self._place)), dtype=np.int64)
        count_frames(record, self._place, *counts)
        return counts


def _link_rows(run: Run) -> RowsOf:
    names, links = (FORGER, *run.names), _Links(run)
    return lambda record: [
        (record.k, record.k * run.step, names[sender], names[receiver], *counts)
        for sender, receiver, *counts in links.links(record)
    ]


def _visit_rows(run: Run) -> RowsOf:
    names = dict(zip(run.numbers, run.names, strict=True))
    totals, graph = node_totals(run.journal.header), run.prepared.scenario.terrain.graph
    if totals is None or graph is None:
        return lambda _: []

    def rows_of(record: TickRecord) -> list[Row]:
        before = len(totals.visits)
        totals.tick(record)
        return [
            (
                record.k,
                visit.at_s,
                names[visit.robot],
                visit.vertex,
                *graph.vertices[visit.vertex],
                visit.idle_s,
                visit.first,
            )
            for visit in totals.visits[before:]
        ]

    return rows_of


_BY_TICK: dict[str, Callable[[Run], RowsOf]] = {
    TICKS.name: _tick_rows,
    ROBOTS.name: _robot_rows,
    LINKS.name: _link_rows,
    VISITS.name: _visit_rows,
}
"""What makes the rows of a table tick by tick, by its name."""


def rows_by_tick(
    run: Run, names: Sequence[str], share: Callable[[float], None] = lambda _: None
) -> Iterator[tuple[str, list[Row]]]:
    """Make rows of tables in one pass over the journal.

    For example, the first pair of the table of ticks is ``("ticks", [(0, 0.0, ...)])``.

    Yield each table's name at least once, with some of its rows, in order. `share` is called with the share of the work
    that is done, 0 to 1.
    """
    makers = {name: _BY_TICK[name](run) for name in names if name in _BY_TICK}
    replayed = GROUND.name in names
    passes = bool(makers) + replayed
    if EVENTS.name in names:
        yield EVENTS.name, _event_rows(run)
    if makers:
        # A journal that is still being written may have grown since the run was opened.
        for record in islice(run.journal.ticks, run.ticks):
            for name, rows_of in makers.items():
                yield name, rows_of(record)
            share((record.k + 1) / run.ticks / passes)
    if replayed:
        yield GROUND.name, _ground_rows(run, lambda done: share((bool(makers) + done) / passes))


def _event_rows(run: Run) -> list[Row]:
    names = {robot.number: robot.name for robot in run.journal.header.robots}
    return [
        (event.k, event.k * run.step, event.kind, names.get(event.robot or 0), event.detail) for event in run.events
    ]


class _ReplayShare(Watcher):
    """Says how far a replay is, and keeps its fog."""

    def __init__(self, ticks: int, share: Callable[[float], None]) -> None:
        self._ticks = ticks
        self._share = share
        self.fog: Fog | None = None

    def after(self, k: int, fog: Fog) -> None:
        """Say how far the replay is."""
        self.fog = fog
        self._share((k + 1) / self._ticks)


def _ground_rows(run: Run, share: Callable[[float], None]) -> list[Row]:
    counter, shown = VisitCounter(run.prepared.patrolled, run.ticks), _ReplayShare(run.ticks, share)
    play(run, [counter, shown])
    assert shown.fog is not None
    ages = shown.fog.age(run.ticks - 1)
    visits, terrain, step = counter.result(), run.prepared.terrain, run.step
    rows, cols = np.nonzero(run.prepared.patrolled)
    return list(
        zip(
            rows.tolist(),
            cols.tolist(),
            (terrain.origin[0] + (cols + 0.5) * terrain.point).tolist(),
            (terrain.origin[1] + (rows + 0.5) * terrain.point).tolist(),
            (visits.mean[rows, cols] * step).tolist(),
            (visits.worst[rows, cols] * step).tolist(),
            (ages[rows, cols] * step).tolist(),
            (~visits.never[rows, cols]).tolist(),
            strict=True,
        )
    )
