"""The figures of a run's summary, added up a second time from the raw ticks by code of its own.

It uses nothing of `patrol.summary` and `worldsim.output`, which make the summary, so that an error there cannot confirm
itself. Frames are counted in tables by sender and receiver, in which number 0 is the forger.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from functools import reduce
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from patrol.journal import Status
from patrol.journal.links import drops_of, links_of
from patrol.journal.records import DEAD_END, FREE, PATROLLING
from worldsim.checks.check import CheckResult, JournalReading
from worldsim.checks.fates import fault_of, kind_of

if TYPE_CHECKING:
    from patrol.journal import RobotTick, TickRecord
    from worldsim.checks.check import JudgedRun

ROUNDING = 1e-9
"""Relative difference of two figures that are equal but for the order in which they were added up."""

LINKED = 64
"""Robots of the largest fleet whose links are in the summary."""

TOGETHER = 256
"""Rows of robots that are added up together, about."""

Found = dict[tuple[str, ...], Any]
"""Figures by their places in the summary, such as ("robots", "r1", "distance_m")."""


class Figures(JournalReading):
    """Columns of a run's ticks, and the figures that follow from them."""

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        size = len(run.names) + 1
        self._ticks: list[tuple[float, float, int, int]] = []  # MFoW and mean fog in s, points seen, forged frames
        self._decision_ms: list[NDArray[np.float64]] = []  # by robot, NaN where it made none
        self._sums = np.zeros((8, size - 1))  # of each robot's rows, as `_add_rows` lists them
        self._rejected = np.zeros((2, size - 1), dtype=np.int64)  # by each robot: in all, and by its present process
        self._frames, self._bytes = np.zeros((2, size), dtype=np.int64)
        self._sent, self._delivered = np.zeros((2, size, size), dtype=np.int64)
        self._dropped = defaultdict[str, NDArray[np.int64]](lambda: np.zeros((size, size), dtype=np.int64))  # by cause
        self._by_fault = Counter[tuple[str, str]]()  # frames by fault and effect
        self._rows: Sequence[RobotTick] = ()  # those of the last tick
        self._slides = np.array([robot.model == "holonomic" for robot in run.journal.header.robots])
        self._records: list[TickRecord] = []  # that are not yet added up
        self._together = max(TOGETHER // size, 1)

    def tick(self, record: TickRecord) -> None:
        """Add the next tick."""
        self._ticks.append((record.mfow * self._step, record.fog_mean * self._step, record.seen, len(record.forged)))
        self._records.append(record)
        if len(self._records) >= self._together:
            self._add_records()

    def _add_records(self) -> None:
        """Add up the records that wait: numpy takes about as long for many small ticks as for one."""
        records, self._records = self._records, []
        if records:
            self._add_rows([record.robots for record in records])
            self._add_frames(records)

    def _add_rows(self, ticks: Sequence[Sequence[RobotTick]]) -> None:
        self._rows = ticks[-1]
        decision_ms = np.array([[math.nan if row.decision_ms is None else row.decision_ms for row in t] for t in ticks])
        decided, alive = ~np.isnan(decision_ms), np.array([[row.status is Status.ALIVE for row in t] for t in ticks])
        numbers = np.array([[(row.c0, row.c1, row.bumped, row.refused) for row in t] for t in ticks])
        c0, c1, bumped, refused = np.moveaxis(numbers, 2, 0)
        way_m = np.hypot(c0, c1 * self._slides) * self._step * (bumped == 0.0)
        states = np.array([[row.state for row in t] for t in ticks])
        stuck, planned, free = (decided & (states == state) for state in (DEAD_END, PATROLLING, FREE))
        self._sums += np.sum((way_m, alive, bumped, refused, decided, stuck, planned, free), axis=1)
        self._decision_ms.extend(decision_ms)
        counts = [self._rejected[1].tolist()]
        for t in ticks:
            counts.append([n if row.rejected is None else row.rejected for row, n in zip(t, counts[-1], strict=True)])
        before, now = np.array(counts)[:-1], np.array(counts)[1:]
        # A new process counts from zero.
        self._rejected[0] += (now - np.where(now < before, 0, before)).sum(axis=0)
        self._rejected[1] = now[-1]

    def _add_frames(self, records: Sequence[TickRecord]) -> None:
        frames = np.zeros((len(records), self._frames.size), dtype=np.int64)  # by tick and sender
        for k, record in enumerate(records):
            for source, frame in record.frames:
                frames[k, source] += 1
                self._bytes[source] += len(frame)
            dropped = drops_of(record.dropped)
            for number, why in enumerate(dropped.causes):
                of = dropped.cause == number
                np.add.at(self._dropped[kind_of(why)], (dropped.source[of], dropped.destination[of]), 1)
                self._by_fault[fault_of(why), "dropped"] += int(np.count_nonzero(of))
            for effect, befell in (("delayed", record.delayed), ("duplicated", record.copies)):
                self._by_fault.update((row[3], effect) for row in befell)
        here = np.array([[False, *(row.status.is_present for row in record.robots)] for record in records])
        self._frames += frames.sum(axis=0)
        self._sent += frames.T @ here
        copies = [row[:2] for record in records for row in record.copies]
        np.add.at(self._sent, tuple(np.array(copies, dtype=np.int64).reshape(-1, 2).T), 1)
        landed = [links_of(record.deliveries) for record in records]
        ends = [np.concatenate(ends) for ends in zip(*((of.source, of.destination) for of in landed), strict=True)]
        np.add.at(self._delivered, tuple(ends), 1)

    def figures(self) -> Found:
        """Return the figures; none before the first tick, and where ticks lack robots."""
        self._add_records()
        run, count = self._run, len(self._ticks)
        if not count or not run.has_robots:
            return {}
        mfow, fog, seen, forged = np.array(self._ticks).T
        way_m, alive, bumped, refused, decided, stuck, planned, free = self._sums
        has_plan = run.prepared.scenario.patrol.needs_rounds or bool(free.any())
        late, size, living_s = mfow[count // 2 :], self._bytes[1:], alive.sum() * self._step
        of_run = {"ticks": count, "simulated_s": count * self._step, "fog_mean_s": fog.mean(), "fog_end_s": fog[-1]}
        of_run |= {"mfow_mean_s": mfow.mean(), "mfow_late_mean_s": late.mean(), "mfow_max_s": mfow.max()}
        of_run |= {"mfow_end_s": mfow[-1], "seen_share": seen[-1] / np.count_nonzero(run.prepared.patrolled)}
        of_run["planned_share"] = _share_of(planned.sum(), free.sum()) if has_plan else None
        of_fleet = {"frames": self._frames[1:].sum(), "bytes": size.sum(), "rejected": self._rejected[0].sum()}
        of_fleet |= {"forged": forged.sum(), "bytes_per_robot_s": size.sum() / max(living_s, self._step)}
        decision_ms = [of[~np.isnan(of)] for of in np.array(self._decision_ms).T]
        robots: dict[str, Any] = {"distance_m": way_m, "collisions": bumped, "refused_commands": refused}
        robots |= {"decisions": decided, "missed": alive - decided, "dead_end_share": stuck / np.maximum(decided, 1.0)}
        shares = list(map(_share_of, planned, free)) if has_plan else [None] * len(planned)
        robots |= {"planned_share": shares}
        robots |= {"bytes": size, "rejected": self._rejected[0], "status": self._last_statuses()}
        for key, percent in (("decision_ms_p50", 50), ("decision_ms_p99", 99)):
            robots[key] = [np.quantile(of, percent / 100) if of.size else None for of in decision_ms]
        figures: Found = {(key,): value for key, value in of_run.items()}
        figures |= {("messages", key): value for key, value in of_fleet.items()}
        figures |= self._count_links(robots) if run.by_ether else {}
        names = enumerate(run.names.values())
        return figures | {("robots", name, key): of[i] for i, name in names for key, of in robots.items()}

    def _last_statuses(self) -> list[str]:
        """Return the robots' statuses, also after the events that follow the last tick."""
        events = [event for event in self._run.journal.events if event.k >= len(self._ticks)]
        last = {event.robot: event.kind for event in events if event.kind.upper() in Status.__members__}
        return [last.get(number, row.status.name.lower()) for number, row in enumerate(self._rows, 1)]

    def _count_links(self, robots: dict[str, Any]) -> Found:
        """Return the figures of frames by cause, fault and link, and of the fleet; add those by sender to `robots`."""
        np.fill_diagonal(self._sent, 0)  # no frame is sent to its own sender
        names, lost = ["forger", *self._run.names.values()], sum(self._dropped.values(), np.zeros_like(self._sent))
        tables = {"sent": self._sent, "delivered": self._delivered, "in_flight": self._sent - self._delivered - lost}
        robots |= {key: table[1:].sum(axis=1) for key, table in (tables | {"dropped": lost}).items()}
        figures: Found = {("messages", key): sum(robots[key]) for key in (*tables, "dropped")}
        causes = {kind: table[1:].sum() for kind, table in self._dropped.items()}
        figures["messages", "dropped_by_cause"] = {kind: count for kind, count in causes.items() if count}
        figures |= {("faults", *of): count for of, count in self._by_fault.items() if of[0]}
        for link in map(tuple, np.argwhere(self._sent) if len(names) <= LINKED + 1 else ()):
            counts: dict[str, Any] = {key: table[link] for key, table in tables.items()}
            counts["dropped"] = {kind: table[link] for kind, table in self._dropped.items() if table[link]}
            figures["links", names[link[0]], names[link[1]]] = counts
        return figures


def _share_of(part: float, rest: float) -> float | None:
    """Return the share of a part in the whole; None of nothing."""
    return part / (part + rest) if part + rest else None


def compare(found: Found, summary: Mapping[str, Any]) -> CheckResult:
    """Compare a summary with the figures that were found, and name the first that differs."""
    for place, figure in found.items():
        summary_value: Any = reduce(lambda part, key: (part or {}).get(key), place, cast("Any", summary))
        is_number = isinstance(summary_value, int | float) and figure is not None
        if not (math.isclose(summary_value, figure, rel_tol=ROUNDING) if is_number else summary_value == figure):
            problem = f"{'.'.join(place)} is {summary_value} in the summary, and {figure} by the ticks"
            return CheckResult("figures", False, problem)
    counted = f"{len(found)} figures of the summary are those of the ticks"
    return CheckResult("figures", True, counted if found else "not judged: there are no ticks to count", bool(found))
