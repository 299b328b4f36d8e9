"""The verdict's checks: each goes through a journal's ticks once and says at the end what it found."""

from __future__ import annotations

import math
from collections import Counter, deque
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Protocol

from patrol.footprint import sensor_footprint
from patrol.journal import Status, TickRecord, TraceHash
from patrol.message import MAX_TRAIL, Position, Rejected, decode
from patrol.pose import Pose
from patrol.records import frame_sequence
from worldsim.intruders import Intruders
from worldsim.record import COMPLETED, INTERRUPTED
from worldsim.truth import Truth

if TYPE_CHECKING:
    from patrol.prepare import Prepared
    from worldsim.record import RunRecord


@dataclass(frozen=True, slots=True)
class Check:
    """One check's result; the detail says what was found, first of all where it went wrong or why it was not judged."""

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

    def __init__(self, journal: RunRecord) -> None:
        self._journal = journal
        self._trace = TraceHash()

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


class FramesAreTrue:
    """A sender's first frame says where it is in that tick, as the wire has it, and its trail where it was before.

    Each of the others reports an intruder that its footprint covers, and none twice. Tags are not looked at: whoever
    hears a frame with a wrong one counts it as rejected.
    """

    def __init__(self, journal: RunRecord, prepared: Prepared) -> None:
        self._names = names_of(journal)
        self._step = prepared.scenario.step
        self._intruders = Intruders(prepared.scenario, sensor_footprint(prepared.scenario, prepared.terrain))
        self._tracks = {number: deque[tuple[int, int]](maxlen=MAX_TRAIL + 1) for number in self._names}
        self._problem = ""
        self._looked = 0

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        if self._problem:
            return
        due: dict[int, Position] = {}
        contacts: dict[int, list[Position]] = {}
        time_s = record.k * self._step
        for row in record.robots:
            pose = Pose(row.x, row.y, row.heading)
            position = Position.of(row.number, record.k, time_s, pose)
            self._tracks[row.number].appendleft((position.x_cm, position.y_cm))
            if row.status is Status.ALIVE:
                due[row.number] = position
                seen = self._intruders.seen_by(row.number, record.k, pose)
                contacts[row.number] = [Position.of_contact(record.k, time_s, *place) for place in seen]
        for source, frame in record.frames:
            if source in due or source not in contacts:
                problem = self._problem_of(source, frame, due.pop(source, None))
            else:
                problem = _problem_of_contact(frame, contacts[source])
            if problem:
                self._problem = f"frame {record.k} of {self._names.get(source, source)} {problem}"
                return
            self._looked += 1

    def check(self) -> Check:
        """The result, once all ticks are in."""
        return Check("frames", not self._problem, self._problem or f"{self._looked} frames say what is true")

    def _problem_of(self, source: int, frame: bytes, due: Position | None) -> str:
        if due is None:
            return "has no living sender"
        try:
            said = decode(frame)
        except Rejected as rejected:
            return f"cannot be read ({rejected})"
        track = list(self._tracks[source])
        trail = tuple((old[0] - new[0], old[1] - new[1]) for new, old in pairwise(track[: len(said.trail) + 1]))
        if said != replace(due, trail=trail):
            return f"says {said}, the pose gives {replace(due, trail=trail)}"
        return ""


class LinksAddUp:
    """On every directed link each frame sent was delivered or dropped once, and nothing else was."""

    def __init__(self, journal: RunRecord) -> None:
        self._names = names_of(journal)
        self._sent = self._settled = 0
        self._open: Counter[tuple[int, int, int]] = Counter()

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        here = [robot.number for robot in record.robots if robot.status not in (Status.ABSENT, Status.LEFT)]
        places: Counter[int] = Counter()
        for source, _ in record.frames:
            sequence = frame_sequence(record.k, places[source])
            places[source] += 1
            for destination in here:
                if destination != source:
                    self._open[source, destination, sequence] += 1
                    self._sent += 1
        for link in [*record.deliveries, *(dropped[:3] for dropped in record.dropped)]:
            self._settled += 1
            self._open[link] -= 1
            if self._open[link] == 0:
                del self._open[link]

    def check(self) -> Check:
        """The result, once all ticks are in."""
        if not self._open:
            return Check("links add up", True, f"{self._sent} frames sent over links, {self._settled} accounted for")
        (source, destination, sequence), left = min(self._open.items())
        link = f"{self._names.get(source, source)} to {self._names.get(destination, destination)}"
        what = "neither delivered nor dropped" if left > 0 else "delivered or dropped but not sent"
        detail = f"frame {sequence} from {link} was {what} ({len(self._open)} such frames)"
        return Check("links add up", False, detail)


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


def _problem_of_contact(frame: bytes, due: list[Position]) -> str:
    """What is wrong with a report; it is taken off those that are due."""
    try:
        said = decode(frame)
    except Rejected as rejected:
        return f"cannot be read ({rejected})"
    if said not in due:
        return f"says {said}, and its sender sees no such intruder"
    due.remove(said)
    return ""


def names_of(journal: RunRecord) -> dict[int, str]:
    """The robots' names by number."""
    return {robot.number: robot.name for robot in journal.header.robots}
