"""The verdict's check of forged frames: each payload by the rules in docs/faults.md, without the code that forges."""

from __future__ import annotations

import math
from collections import defaultdict, deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from patrol.faults.kinds import Drift, Forgery, Spoof
from patrol.journal import Status, TickRecord
from patrol.journal.records import FORGED
from patrol.radio.message import MAX_ROBOT, Position, Rejected, decode
from patrol.radio.units import m_to_cm, s_to_ms
from worldsim.verdict.common.faults import NO_ROBOT, FrameFaultCheck, active

if TYPE_CHECKING:
    from patrol.journal.records import RobotTick
    from worldsim.faults import Entry
    from worldsim.verdict.common.check import JudgedRun, Readings

_HALF_CM = 0.5 + 1e-6
"""Largest difference of a coordinate on the wire from the one that was rounded, cm."""

Place = tuple[int, int, int]
"""x and y in cm and the heading in mrad, as a frame has them."""


@dataclass(frozen=True, slots=True)
class _Spoof:
    """A spoof and the content that its frames should have."""

    entry: Entry
    kind: str  # "freeze" or "random", else the name of the payload's field
    offset: tuple[float, float] = (0.0, 0.0)  # along x and y, m
    ahead: int = 0  # ticks by which sequences run ahead
    invented: int = 0  # number of invented robots
    age: int = 0  # of the frames that a replay repeats, ticks


@dataclass(frozen=True, slots=True)
class _Victim:
    """The known frames of a robot in whose name frames are forged."""

    row: RobotTick
    sent: Position | None  # its own position of the tick, None if it sent none
    honest: bool  # no drift makes it report a wrong place


class SpoofsAsAsked(FrameFaultCheck):
    """Each active spoof sends one frame in each victim's name, or one for each robot it invents, saying what it should.

    Nothing else is forged: not before or after the fault, not by a robot that is not alive, not in the name of a robot
    of which nothing can be said yet. `offset`, `freeze` and `ahead` are compared with the victim's own frame of the
    tick; where it sends none, with its true place, unless a drift makes it wrong about that.
    """

    name = "forgeries"
    kinds = (Spoof,)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        scenario = run.prepared.scenario
        self._step = scenario.step
        self._robots = len(scenario.roster)
        self._spares = scenario.spares
        self._bounds = run.prepared.terrain.bounds
        self._spoofs = {e.id: _spoof(e, e.fault, self._step) for e in self._entries if isinstance(e.fault, Spoof)}
        self._drifts = [entry for entry in run.timeline.entries if isinstance(entry.fault, Drift)]
        self._sent: deque[Mapping[int, bytes]] = deque(maxlen=1 + max(s.age for s in self._spoofs.values()))
        self._frozen: dict[tuple[str, int], Place] = {}
        self._forged = 0

    def _tick(self, record: TickRecord) -> None:
        frames = [frame for source, frame in record.frames if source == FORGED]
        forged: dict[str, list[bytes]] = defaultdict(list)
        for fault, frame in zip(record.forged, frames, strict=False):
            forged[fault].append(frame)
        if len(frames) != len(record.forged):
            self._wrong(record.k, f"{len(frames)} forged frames, but the record names faults for {len(record.forged)}")
        own: dict[int, bytes] = {}
        for source, frame in record.frames:
            own.setdefault(source, frame)
        self._sent.appendleft(own)
        self._forged += len(frames)
        rows = {row.number: row for row in record.robots}
        for fault, spoof in self._spoofs.items():
            origin = spoof.entry.sources[0]
            on = active(spoof.entry, record.k) and (origin == NO_ROBOT or rows[origin].status is Status.ALIVE)
            sent = forged.pop(fault, [])
            if on:
                problem = self._problem_of(spoof, record.k, sent, rows)
            else:
                problem = "sends forged frames and should not" if sent else ""
            if problem:
                self._wrong(record.k, f"{fault} {problem}")
        for fault in forged:
            self._wrong(record.k, f"{fault} sends forged frames and is not a spoof")

    def _good(self) -> str:
        return f"{self._forged} frames forged as configured"

    def _problem_of(self, spoof: _Spoof, k: int, frames: list[bytes], rows: Mapping[int, RobotTick]) -> str:
        """Describe errors in the frames that an active spoof sends in a tick."""
        if spoof.kind == "replay":
            return self._problem_of_repeats(spoof, frames, rows)
        due = list(self._due(spoof, rows))
        try:
            positions = sorted((decode(frame) for frame in frames), key=lambda position: position.robot)
        except Rejected as rejected:
            return f"sends a frame that cannot be decoded ({rejected})"
        if [position.robot for position in positions] != due:
            return f"forges in the names of robots {[position.robot for position in positions]} instead of {due}"
        for position in positions:
            problem = self._problem_of_one(spoof, k, position, self._victim(rows, position.robot, k))
            if problem:
                return f"claims for robot {position.robot}: {problem}"
        return ""

    def _due(self, spoof: _Spoof, rows: Mapping[int, RobotTick]) -> Iterator[int]:
        """Yield the robots to forge, ascending: victims whose place is known, or robots that do not exist."""
        if spoof.kind == "invented":
            yield from range(self._robots + 1, min(self._robots + spoof.invented, MAX_ROBOT) + 1)
            return
        for number in self._known(spoof, rows):
            if spoof.kind == "random" or (spoof.entry.id, number) in self._frozen or rows[number].status.is_present:
                yield number

    def _known(self, spoof: _Spoof, rows: Mapping[int, RobotTick]) -> Iterator[int]:
        """Yield the victims without the spare robots that have not joined yet."""
        for number in spoof.entry.who:
            if rows[number].status is not Status.ABSENT or number not in self._spares:
                yield number

    def _victim(self, rows: Mapping[int, RobotTick], number: int, k: int) -> _Victim | None:
        """Return the known frames of a robot, or None if it does not exist."""
        if number not in rows:
            return None
        try:
            sent = decode(self._sent[0][number]) if number in self._sent[0] else None
        except Rejected:
            sent = None
        drifts = any(active(entry, k) and number in entry.who for entry in self._drifts)
        return _Victim(rows[number], sent, not drifts)

    def _problem_of_one(self, spoof: _Spoof, k: int, position: Position, victim: _Victim | None) -> str:
        """Describe the error of a forged position that is no replay."""
        if position.sequence != k + spoof.ahead:
            return f"sequence {position.sequence} instead of {k + spoof.ahead}"
        stamp = position.time_ms
        if victim is None:
            stamp = round(s_to_ms(k * self._step))
        elif victim.sent is not None:
            stamp = victim.sent.time_ms
        if position.time_ms != stamp:
            return f"time {position.time_ms} ms instead of {stamp} ms"
        place = (position.x_cm, position.y_cm, position.heading_mrad)
        if victim is None or spoof.kind == "random":
            return "" if self._on_terrain(position) else f"place {place}, which is off the terrain"
        if spoof.kind == "freeze":
            frozen = self._frozen.get((spoof.entry.id, position.robot))
            if frozen is not None:
                return "" if place == frozen else f"place {place}, but it was frozen at {frozen}"
            self._frozen[spoof.entry.id, position.robot] = place
        return "" if _shifted(place, victim, spoof.offset) else f"place {place}, not its own plus the offset"

    def _problem_of_repeats(self, spoof: _Spoof, frames: list[bytes], rows: Mapping[int, RobotTick]) -> str:
        """Describe the errors of repeated frames: they should be those of the configured time, byte by byte."""
        old = self._sent[spoof.age] if spoof.age < len(self._sent) else {}
        due = sorted(old[number] for number in self._known(spoof, rows) if number in old)
        return "" if sorted(frames) == due else f"does not repeat what its victims sent {spoof.age} ticks ago"

    def _on_terrain(self, position: Position) -> bool:
        x_min, y_min, x_max, y_max = (m_to_cm(bound) for bound in self._bounds)
        across = x_min - _HALF_CM <= position.x_cm <= x_max + _HALF_CM
        return across and y_min - _HALF_CM <= position.y_cm <= y_max + _HALF_CM

    def _wrong(self, k: int, problem: str) -> None:
        self._fail(f"tick {k}: {problem}")


def _spoof(entry: Entry, fault: Spoof, step: float) -> _Spoof:
    payload = fault.payload
    if not isinstance(payload, Forgery):
        return _Spoof(entry, payload)
    if payload.replay is not None:
        return _Spoof(entry, "replay", age=_ago(payload.replay, step))
    if payload.invented is not None:
        return _Spoof(entry, "invented", invented=payload.invented)
    if payload.ahead is not None:
        return _Spoof(entry, "ahead", ahead=payload.ahead)
    return _Spoof(entry, "offset", offset=payload.offset or (0.0, 0.0))


def _ago(seconds: float, step: float) -> int:
    """Return the least number of whole ticks, at least one, that is not less than a time in seconds."""
    near = max(round(seconds / step), 1)
    return near if near * step >= seconds - 1e-9 * step else near + 1


def _shifted(place: Place, victim: _Victim, offset: tuple[float, float]) -> bool:
    """Return True if a place is the victim's, shifted by an offset (m), as far as the wire's rounding can tell."""
    x, y, heading = place
    if (sent := victim.sent) is not None:
        near = 2.0 * _HALF_CM if any(offset) else 0.0
        own_x, own_y, same = float(sent.x_cm), float(sent.y_cm), heading == sent.heading_mrad
    else:
        near, same = _HALF_CM if victim.honest else math.inf, True
        own_x, own_y = m_to_cm(victim.row.x), m_to_cm(victim.row.y)
    return same and abs(x - own_x - m_to_cm(offset[0])) <= near and abs(y - own_y - m_to_cm(offset[1])) <= near
