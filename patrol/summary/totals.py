"""The metrics that a journal's ticks give, added up tick by tick.

The world's summary (`worldsim.output.summary`) and a report on a run without one (`monitor.replay.run`) use the same
totals.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from patrol.journal.links import drops_of, links_of
from patrol.journal.records import DEAD_END, FORGED, FREE, PATROLLING, Status, standing_after
from patrol.pose import command_of
from patrol.scenario.policies import COMMITTED, STOCHASTIC
from patrol.scenario.sections import VERTICES
from patrol.summary.model import Messages, RobotFigures, Summary

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from patrol.journal.records import Event, Header, RobotTick, TickRecord


def count_frames(
    record: TickRecord, place: Mapping[int, int], sent: NDArray[np.integer[Any]], delivered: NDArray[np.integer[Any]]
) -> None:
    """Add one tick to `sent` and `delivered`, the counts (n, n) of frames, sender by receiver, in place.

    `place` is the row and column of each robot, by robot number. Robots without a place are not counted;
    `patrol.journal.records.FORGED` is counted as a sender if it has a place. `sent` counts every frame sent, also those
    delivered or dropped in a later tick.
    """
    present = [place[row.number] for row in record.robots if row.status.is_present and row.number in place]
    for source, frames in Counter(source for source, _ in record.frames).items():
        if source in place:
            origin = place[source]
            sent[origin, [to for to in present if to != origin]] += frames
    for source, to, _, _ in record.copies:
        if source in place and to in place:
            sent[place[source], place[to]] += 1
    for source, to, _ in record.deliveries:
        if source in place and to in place:
            delivered[place[source], place[to]] += 1


@dataclass(slots=True)
class _Robot:
    """The totals of one robot's rows.

    sent, delivered and dropped refer to the robot's own frames, counted per receiver; copies made by a fault count as
    sent.
    """

    model: str
    distance_m: float = 0.0
    collisions: int = 0
    refused: int = 0
    dead_ends: int = 0
    planned: int = 0
    free: int = 0
    living: int = 0
    frames: int = 0
    frame_bytes: int = 0
    sent: int = 0
    delivered: int = 0
    rejected: int = 0
    rejected_before: int = 0
    status: Status = Status.ABSENT
    decision_ms: list[float] = field(default_factory=list)
    dropped: Counter[str] = field(default_factory=Counter)

    def take(self, row: RobotTick, step: float) -> None:
        """Add one tick's row."""
        self.status = row.status
        self.living += row.status is Status.ALIVE
        self.collisions += row.bumped
        self.refused += row.refused
        if not row.bumped:
            self.distance_m += command_of(self.model, row.c0, row.c1).speed_mps * step
        if row.decision_ms is not None:
            self.decision_ms.append(row.decision_ms)
            self.dead_ends += row.state == DEAD_END
            self.planned += row.state == PATROLLING
            self.free += row.state == FREE
        if row.rejected is not None:
            if row.rejected < self.rejected:  # a new process, which counts from zero
                self.rejected_before += self.rejected
            self.rejected = row.rejected

    def figures(self, has_plan: bool) -> RobotFigures:
        """Return this robot's metrics; `has_plan` is True if its policy has a plan or round for the whole fleet."""
        decisions = len(self.decision_ms)
        return RobotFigures(
            status=self.status.name.lower(),
            distance_m=self.distance_m,
            dead_end_share=self.dead_ends / decisions if decisions else 0.0,
            planned_share=_planned_share([self]) if has_plan else None,
            collisions=self.collisions,
            decisions=decisions,
            missed=self.living - decisions,
            refused_commands=self.refused,
            decision_ms_p50=_percentile_of(self.decision_ms, 50),
            decision_ms_p99=_percentile_of(self.decision_ms, 99),
            bytes=self.frame_bytes,
            sent=self.sent,
            delivered=self.delivered,
            dropped=self.dropped.total(),
            in_flight=self.sent - self.delivered - self.dropped.total(),
            rejected=self.rejected_before + self.rejected,
        )


class RunTotals:
    """The running totals of a run; see `figures`."""

    def __init__(self, header: Header, step: float, patrolled: int) -> None:
        """Start before the first tick; `patrolled` is the number of points of the patrolled ground."""
        self._header = header
        self._step = step
        self._patrolled = patrolled
        self._robots = {robot.number: _Robot(robot.model) for robot in header.robots}
        self._mfow: list[int] = []
        self._fog: list[float] = []
        self._seen = 0
        self._forged = 0

    def tick(self, record: TickRecord) -> None:
        """Add the next tick; KeyError for a robot, or a frame of one, that the header does not have."""
        self._mfow.append(record.mfow)
        self._fog.append(record.fog_mean)
        self._seen = record.seen
        self._forged += len(record.forged)
        robots = self._robots
        for row in record.robots:
            robots[row.number].take(row, self._step)
        # All but the sender itself, which is present.
        receivers = sum(row.status.is_present for row in record.robots) - 1
        for source, frame in record.frames:
            if source != FORGED:
                robots[source].frames += 1
                robots[source].frame_bytes += len(frame)
                robots[source].sent += receivers
        for source, _, _, _ in record.copies:
            if source != FORGED:
                robots[source].sent += 1
        for source, count in enumerate(np.bincount(links_of(record.deliveries).source).tolist()):
            if source != FORGED and count:
                robots[source].delivered += count
        for source, cause, count in dropped_by_source(record):
            if source != FORGED:
                robots[source].dropped[cause.partition(":")[0]] += count

    def figures(self, events: Iterable[Event]) -> Summary:
        """Return the metrics so far; what else a summary holds is not set.

        Events after the run's last tick may change a robot's status.
        """
        header, step, mfow = self._header, self._step, self._mfow
        planning = header.scenario["patrol"]["policy"] in (COMMITTED, STOCHASTIC)
        # A class of one's own says so by its robots' states.
        has_plan = planning or any(robot.free for robot in self._robots.values())
        ticks = len(mfow)
        for event in events:
            standing = standing_after(event.kind)
            if event.k >= ticks and event.robot in self._robots and standing is not None:
                self._robots[event.robot].status = standing
        return Summary(
            ticks=ticks,
            simulated_s=ticks * step,
            mfow_mean_s=float(np.mean(mfow)) * step if ticks else None,
            mfow_late_mean_s=float(np.mean(mfow[ticks // 2 :])) * step if ticks else None,
            mfow_max_s=max(mfow) * step if ticks else None,
            mfow_end_s=mfow[-1] * step if ticks else None,
            fog_mean_s=float(np.mean(self._fog)) * step if ticks else None,
            fog_end_s=self._fog[-1] * step if ticks else None,
            seen_share=self._seen / self._patrolled,
            planned_share=_planned_share(self._robots.values()) if has_plan else None,
            bound_s=header.bound_s,
            patrolled_area_m2=header.patrolled_area_m2,
            **self._count_vertices(),
            point_m=header.terrain.point,
            messages=self._sum_messages(),
            robots={facts.name: self._robots[facts.number].figures(has_plan) for facts in header.robots},
        )

    def _count_vertices(self) -> dict[str, Any]:
        """Return the number of vertices that count; nothing where ground does."""
        terrain = self._header.scenario.get("terrain", {})
        return {"patrolled_vertices": len(terrain["graph"]["vertices"])} if terrain.get("patrolled") == VERTICES else {}

    def _sum_messages(self) -> Messages:
        robots = list(self._robots.values())
        causes: Counter[str] = Counter()
        for robot in robots:
            causes.update(robot.dropped)
        living_s = sum(robot.living for robot in robots) * self._step
        size = sum(robot.frame_bytes for robot in robots)
        return Messages(
            frames=sum(robot.frames for robot in robots),
            bytes=size,
            sent=sum(robot.sent for robot in robots),
            delivered=sum(robot.delivered for robot in robots),
            dropped=causes.total(),
            dropped_by_cause=dict(sorted(causes.items())),
            in_flight=sum(robot.sent - robot.delivered for robot in robots) - causes.total(),
            rejected=sum(robot.rejected_before + robot.rejected for robot in robots),
            bytes_per_robot_s=size / living_s if living_s else 0.0,
            forged=self._forged,
        )


def dropped_by_source(record: TickRecord) -> list[tuple[int, str, int]]:
    """Count the frames dropped in a tick, without zeros, as (source, cause, frames); for example (1, "loss:f1", 4)."""
    drops = drops_of(record.dropped)
    if not len(drops):
        return []
    kinds = len(drops.causes)
    # One number for each pair, since sorting numbers is far faster than counting pairs in Python.
    pairs, counts = np.unique(drops.source * kinds + drops.cause, return_counts=True)
    rows = zip(pairs.tolist(), counts.tolist(), strict=True)
    return [(pair // kinds, drops.causes[pair % kinds], count) for pair, count in rows]


def _planned_share(robots: Collection[_Robot]) -> float | None:
    """Return the share of the ticks on patrol that went by the common plan or round; None without such a tick."""
    planned = sum(robot.planned for robot in robots)
    patrolled = planned + sum(robot.free for robot in robots)
    return planned / patrolled if patrolled else None


def _percentile_of(values: list[float], percent: float) -> float | None:
    return float(np.percentile(values, percent)) if values else None
