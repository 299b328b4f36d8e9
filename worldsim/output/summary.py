"""The summary of a run, as in `summary.json`: computed from the journal's records, the verdict and the wall time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from patrol.best_tour import best_tour
from patrol.journal import Event, Header, RobotTick, Status, TickRecord
from patrol.journal.links import links_of
from patrol.journal.records import DEAD_END, FORGED, standing_after
from patrol.pose import command_of
from worldsim.output.direct_radio import as_measured
from worldsim.output.intruder_facts import IntruderFacts
from worldsim.output.traffic import Traffic, dropped_by_source
from worldsim.radio.ether import there
from worldsim.robots.motion import length

if TYPE_CHECKING:
    from patrol.prepare import Prepared
    from worldsim.run_record import RunRecord
    from worldsim.verdict.judge import Verdict
    from worldsim.verdict.run.progress import LongestStay, Stalest, TrappedRobot


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
            command = command_of(self.model, row.c0, row.c1)
            self.distance_m += length(command, step)
        if row.decision_ms is not None:
            self.decision_ms.append(row.decision_ms)
            self.dead_ends += row.state == DEAD_END
        if row.rejected is not None:
            if row.rejected < self.rejected:  # a new process, which counts from zero
                self.rejected_before += self.rejected
            self.rejected = row.rejected

    def facts(self, stay: LongestStay | None) -> dict[str, Any]:
        """This robot's part of the summary.

        Args:
            stay: Its longest stay; None where nobody looked.
        """
        decisions = len(self.decision_ms)
        return {
            "status": self.status.name.lower(),
            "distance_m": self.distance_m,
            "dead_end_share": self.dead_ends / decisions if decisions else 0.0,
            "collisions": self.collisions,
            "longest_stay_s": None if stay is None else stay.seconds,
            "longest_stay": None if stay is None else asdict(stay),
            "decisions": decisions,
            "missed": self.living - decisions,
            "refused_commands": self.refused,
            "decision_ms_p50": _percentile(self.decision_ms, 50),
            "decision_ms_p99": _percentile(self.decision_ms, 99),
            "sent": self.sent,
            "delivered": self.delivered,
            "dropped": self.dropped.total(),
            "in_flight": self.sent - self.delivered - self.dropped.total(),
            "rejected": self.rejected_before + self.rejected,
        }


class Totals:
    """The running totals of a run; see `summarise`."""

    def __init__(self, header: Header, events: Sequence[Event] = ()) -> None:
        """Start before the first tick.

        Args:
            header: Of the journal.
            events: All events of the run, which may include faults added by operators.
        """
        self._header = header
        self._step = float(header.scenario["step"])
        self._robots = {robot.number: _Robot(robot.model) for robot in header.robots}
        self._mfow: list[int] = []
        self._fog: list[float] = []
        self._seen = 0
        self._forged = 0
        self._traffic = Traffic(header, events)
        self._intruders = IntruderFacts(header, events)

    def tick(self, record: TickRecord) -> None:
        """Add the next tick."""
        self._mfow.append(record.mfow)
        self._fog.append(record.fog_mean)
        self._seen = record.seen
        self._forged += len(record.forged)
        self._traffic.tick(record)
        self._intruders.tick(record)
        _take(self._robots, record, self._step)

    def summary(self, journal: RunRecord, verdict: Verdict, prepared: Prepared | None = None) -> dict[str, Any]:
        """The run's summary after its last tick, when the journal has ended; does not read the journal's ticks.

        Args:
            journal: The run's records.
            verdict: Of the run.
            prepared: As for `summarise`.

        Returns:
            See `summarise`.
        """
        header, step, mfow = self._header, self._step, self._mfow
        ticks = len(mfow)
        wall_s = journal.end.notes.get("wall_s") if journal.end else None
        for event in journal.events:
            standing = standing_after(event.kind)
            if event.k >= ticks and event.robot in self._robots and standing is not None:
                self._robots[event.robot].status = standing
        progress = verdict.progress
        stays = {} if progress is None else progress.stays
        patrolled = round(header.patrolled_area_m2 / header.terrain.point**2)
        summary = {
            "name": header.scenario["name"],
            "scenario_hash": header.scenario_hash,
            "trace_hash": journal.end.trace_hash if journal.end else None,
            "ended": journal.end.reason if journal.end else None,
            "ticks": ticks,
            "simulated_s": ticks * step,
            "wall_s": wall_s,
            "realtime_factor": ticks * step / wall_s if wall_s else None,
            "mfow_mean_s": float(np.mean(mfow)) * step if ticks else None,
            "mfow_late_mean_s": float(np.mean(mfow[ticks // 2 :])) * step if ticks else None,
            "mfow_max_s": max(mfow) * step if ticks else None,
            "mfow_end_s": mfow[-1] * step if ticks else None,
            "fog_mean_s": float(np.mean(self._fog)) * step if ticks else None,
            "seen_share": self._seen / patrolled,
            "bound_s": header.bound_s,
            **_tour(prepared),
            "trapped": [] if progress is None else [_trapped(one) for one in progress.trapped],
            "stalest": {} if progress is None else {"worst": _as_facts(progress.worst), "end": _as_facts(progress.end)},
            "patrolled_area_m2": header.patrolled_area_m2,
            "point_m": header.terrain.point,
            "sensor_range_m": float(header.scenario["sensor"]["range"]),
            "messages": {**_messages(list(self._robots.values()), step), "forged": self._forged},
            "robots": {
                facts.name: self._robots[facts.number].facts(stays.get(facts.number)) for facts in header.robots
            },
            "links": self._traffic.links(),
            "faults": self._traffic.faults(),
            **self._intruders.facts(),
            **_of_processes(journal),
            "verdict": {
                "valid": verdict.valid,
                "outcome": verdict.outcome,
                "warnings": list(verdict.warnings),
                "checks": [{**asdict(check), "warnings": list(check.warnings)} for check in verdict.checks],
            },
        }
        return as_measured(summary, journal) if header.scenario["radio"].get("via") == "direct" else summary


def summarise(journal: RunRecord, verdict: Verdict, prepared: Prepared | None = None) -> dict[str, Any]:
    """The run's summary, ready for JSON.

    Times are in simulated seconds unless the name says wall. Means are over all ticks from the first on;
    `mfow_late_mean_s` is over those of the second half.

    A message is counted once per receiver, and so are the copies that faults make: sent = delivered + dropped + in
    flight. `frames` counts it once, and `bytes` is the size of these frames. Forged frames are counted apart: as
    `forged`, and in `links` under the sender `forger`.

    - `links`: by sender and receiver, for fleets of at most `worldsim.output.traffic.MOST_ROBOTS`.
    - `faults`: by id, the frames on a fault's links while it was active, and its effects on them.
    - `intruders`: see `worldsim.output.intruder_facts`; missing where there are none.
    - `bytes_per_robot_s`: bytes that a living robot sends per second.
    - `trapped`: every time for which a robot was trapped (`worldsim.verdict.run.progress.TrappedRobot`).
    - `stalest`: the stalest place over the run (`worst`) and at its end (`end`), with its age, the time, and the robot
      that was nearest to it then.
    - `longest_stay_s`: the longest time for which a robot that took part stayed in one circle of four times its radius
      and its stride together; `longest_stay` says where and from when (`patrol.stays`).
    - `bound_s`: a lower bound of MFoW, 0 where discs of the sensor's range around all robots have a larger area than
      the ground.
    - `best_tour_s`: the MFoW that the robots keep on the best tour found (`patrol.best_tour`), and `best_tour_m` its
      length; None where there is no tour. It counts all robots that are not spare, whether or not they were ever down.
    - `missed`: ticks in which no command came in time.
    - `refused_commands`: invalid commands.
    - `refused`, for a fleet of processes: messages that the world dropped unread, by reason.
    - `deadlines`, for processes at the pace of the clock: late frames and commands by robot; `too_late`, those of the
      frames that came after all (they reach no robot and are not among the sent); and how far the world itself fell
      behind, in wall seconds.

    For direct radio see `worldsim.output.direct_radio.as_measured`.

    Args:
        journal: The run's records.
        verdict: Of the run.
        prepared: The run's scenario and its terrain, for the best tour found; None leaves that out.
    """
    totals = Totals(journal.header, journal.events)
    for record in journal.ticks:
        totals.tick(record)
    return totals.summary(journal, verdict, prepared)


def _tour(prepared: Prepared | None) -> dict[str, float | None]:
    """The bound of the best tour found for all robots that are not spare."""
    if prepared is None:
        return {"best_tour_s": None, "best_tour_m": None}
    tour = best_tour(prepared)
    shares = {spec.number: 1.0 for spec in prepared.scenario.roster if not spec.spare}
    return {"best_tour_s": tour.bound_s(shares), "best_tour_m": tour.length_m}


def _trapped(one: TrappedRobot) -> dict[str, Any]:
    return {**asdict(one), "stale": list(one.stale)}


def _as_facts(stalest: Stalest | None) -> dict[str, Any] | None:
    return None if stalest is None else asdict(stalest)


def _of_processes(journal: RunRecord) -> dict[str, Any]:
    """The facts about a fleet of processes in the journal's end; none for a fleet in one process."""
    notes = journal.end.notes if journal.end else {}
    facts = {"refused": notes["refused"]} if "refused" in notes else {}
    if "late_commands" in notes:
        names = {robot.number: robot.name for robot in journal.header.robots}
        late = {
            what: {names[robot]: n for robot, n in notes.get(what, {}).items() if robot in names}
            for what in ("late_frames", "too_late", "late_commands")
        }
        # Before runs counted it, the world was never forgiven.
        held_up = {what: notes.get(what, 0.0) for what in ("slipped_s", "held_up_s", "longest_held_up_s")}
        facts["deadlines"] = {**late, **held_up}
    return facts


def _take(robots: dict[int, _Robot], record: TickRecord, step: float) -> None:
    for row in record.robots:
        robots[row.number].take(row, step)
    receivers = sum(there(row.status) for row in record.robots) - 1
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


def _messages(robots: list[_Robot], step: float) -> dict[str, Any]:
    causes: Counter[str] = Counter()
    for robot in robots:
        causes.update(robot.dropped)
    living_s = sum(robot.living for robot in robots) * step
    return {
        "frames": sum(robot.frames for robot in robots),
        "bytes": sum(robot.frame_bytes for robot in robots),
        "sent": sum(robot.sent for robot in robots),
        "delivered": sum(robot.delivered for robot in robots),
        "dropped": causes.total(),
        "dropped_by_cause": dict(sorted(causes.items())),
        "in_flight": sum(robot.sent - robot.delivered for robot in robots) - causes.total(),
        "rejected": sum(robot.rejected_before + robot.rejected for robot in robots),
        "bytes_per_robot_s": sum(robot.frame_bytes for robot in robots) / living_s if living_s else 0.0,
    }


def _percentile(values: list[float], percent: float) -> float | None:
    return float(np.percentile(values, percent)) if values else None
