"""The verdict's checks: each goes through a journal's ticks once and says at the end what it found."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from patrol.ground.footprint import sensor_footprint
from patrol.journal import Status, TickRecord, TraceHash
from patrol.pose import Pose
from worldsim.run_record import COMPLETED, INTERRUPTED
from worldsim.truth import Truth

if TYPE_CHECKING:
    from patrol.prepare import Prepared
    from worldsim.run_record import RunRecord


@dataclass(frozen=True, slots=True)
class Check:
    """One check's result; the detail says what was found, first of all where it went wrong.

    judged: False where there was nothing to judge by, or too little; then it is ok and the detail says why.
    """

    name: str
    ok: bool
    detail: str
    judged: bool = True


class Tally(Protocol):
    """A check at work."""

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        ...

    def check(self) -> Check:
        """The result, once all ticks are in."""
        ...


class Complete:
    """Every tick is there, in order, and the run ended by its end record."""

    def __init__(self, journal: RunRecord) -> None:
        self._journal = journal
        self._next = 0
        self._gap = ""

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        if record.k != self._next and not self._gap:
            self._gap = f"tick {record.k} follows tick {self._next - 1}"
        self._next = record.k + 1

    def check(self) -> Check:
        """The result, once all ticks are in."""
        scenario = self._journal.header.scenario
        due = round(scenario["duration"] / scenario["step"])
        problem = self._gap
        end = self._journal.end
        if self._journal.truncated:
            problem = problem or f"the journal is damaged after tick {self._next - 1}"
        elif end is None:
            problem = problem or f"the journal stops after tick {self._next - 1} without an end"
        elif end.reason not in (COMPLETED, INTERRUPTED):
            problem = problem or f"the run ended after {self._next} ticks: {end.reason}"
        elif end.reason == COMPLETED and self._next != due:
            problem = problem or f"{self._next} of {due} ticks"
        done = f"{self._next} of {due} ticks" + (", interrupted" if self._next < due else "")
        return Check("complete", not problem, problem or done)


class TraceAgrees:
    """The trace hash recomputed from the ticks is the recorded one."""

    def __init__(self, journal: RunRecord, spares: Collection[int]) -> None:
        """spares: numbers of the scenario's spare robots."""
        self._journal = journal
        self._trace = TraceHash(spares)

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        self._trace.tick(record)

    def check(self) -> Check:
        """The result, once all ticks are in."""
        found = self._trace.hexdigest()
        end = self._journal.end
        recorded = end.trace_hash if end else "nothing"
        ok = found == recorded
        return Check("trace", ok, found if ok else f"the ticks hash to {found}, recorded is {recorded}")


class NobodyLost:
    """No robot died unasked."""

    def __init__(self, journal: RunRecord) -> None:
        self._journal = journal
        self._names = names_of(journal)
        self._lost: dict[int, str] = {}

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        for robot in record.robots:
            if robot.status is Status.LOST and robot.number not in self._lost:
                self._lost[robot.number] = f"{self._names.get(robot.number, robot.number)} at tick {record.k}"

    def check(self) -> Check:
        """The result, once all ticks are in."""
        told = {
            event.robot: f"{self._names[event.robot]} at tick {event.k} ({event.detail})"
            for event in self._journal.events
            if event.kind == Status.LOST.name.lower() and event.robot in self._names
        }
        details = "; ".join({**self._lost, **told}.values())
        return Check("nobody lost", not details, f"lost: {details}" if details else "nobody")


class RobotsThere:
    """Every tick holds the scenario's robots, in roster order, each somewhere on the terrain.

    What does not cannot be looked at any further: the checks that compute from poses stop where this one fails.
    """

    def __init__(self, prepared: Prepared) -> None:
        self._terrain = prepared.terrain
        self._roster = [spec.number for spec in prepared.scenario.roster]
        self._names = [spec.name for spec in prepared.scenario.roster]
        self._problem = ""

    @property
    def ok(self) -> bool:
        """Whether nothing was wrong so far."""
        return not self._problem

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        if self._problem:
            return
        if [row.number for row in record.robots] != self._roster:
            self._problem = f"tick {record.k} does not hold the scenario's robots"
            return
        for name, row in zip(self._names, record.robots, strict=True):
            if not (self._terrain.contains(row.x, row.y) and math.isfinite(row.heading)):
                self._problem = f"{name} is nowhere at tick {record.k}: ({row.x}, {row.y}; {row.heading} rad)"

    def check(self) -> Check:
        """The result, once all ticks are in."""
        return Check("robots there", self.ok, self._problem or f"{len(self._roster)} in every tick")


class FogIsTrue:
    """MFoW, mean fog and points seen are what the poses give, recomputed from the beginning."""

    def __init__(self, prepared: Prepared) -> None:
        self._step = prepared.scenario.step
        footprint = sensor_footprint(prepared.scenario, prepared.terrain)
        self._truth = Truth(footprint, prepared.patrolled, self._step)
        self._problem = ""
        self._ticks = 0

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        if self._problem:
            return
        poses = [(r.number, Pose(r.x, r.y, r.heading)) for r in record.robots if r.status is Status.ALIVE]
        self._truth.observe(record.k, poses)
        self._ticks += 1
        fog = self._truth.fog
        found = (fog.mfow(record.k), fog.mean(record.k), fog.seen)
        recorded = (record.mfow, record.fog_mean, record.seen)
        if found != recorded:
            shown = [f"MFoW {m * self._step:g} s, mean {a * self._step:g} s, {n} seen" for m, a, n in (found, recorded)]
            self._problem = f"tick {record.k}: the poses give {shown[0]}; recorded is {shown[1]}"

    def check(self) -> Check:
        """The result, once all ticks are in."""
        return Check("fog", not self._problem, self._problem or f"recomputed over {self._ticks} ticks")


def names_of(journal: RunRecord) -> dict[int, str]:
    """The robots' names by number."""
    return {robot.number: robot.name for robot in journal.header.robots}
