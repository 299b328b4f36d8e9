"""The verdict's checks of sent frames: genuine ones tell the truth and keep to the budget, forged ones are as asked.

Forged frames are judged by the rules in docs/faults.md, without the code that forges.
"""

from __future__ import annotations

import math
from collections import defaultdict, deque
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from patrol.errors import BadInput
from patrol.faults.kinds import Drift, Spoof
from patrol.ground.own_place import OwnPlace
from patrol.journal import Status, TickRecord
from patrol.journal.records import FORGED
from patrol.pose import Command, Pose, halted
from patrol.radio.message import (
    MAX_ROBOT,
    MAX_TIME_MS,
    MAX_TRAIL,
    Position,
    Rejected,
    decode,
    encode,
    longest_frame,
    m_to_cm,
    s_to_ms,
)
from patrol.radio.peers import Predictor
from runtime.security.private_files import fleet_key
from worldsim.checks.check import NO_ROBOT, TAGS_NOT_JUDGED, Check, active, robots_hit
from worldsim.checks.ground import ClosedGround
from worldsim.robots.senses import Senses
from worldsim.truth import Intruders

if TYPE_CHECKING:
    from patrol.ground.terrain import Terrain
    from patrol.journal import RobotTick
    from patrol.scenario import Scenario
    from worldsim.checks.check import JudgedRun
    from worldsim.faults import Entry

BITS = 8

WINDOW_S = 10.0
"""Over which the busiest stretch is measured, s."""

ROUNDING_BITS = 1e-3

_HALF_CM = 0.5 + 1e-6
"""Largest difference of a coordinate on the wire from the one that was rounded, cm."""

Place = tuple[int, int, int]
"""x and y in cm and the heading in mrad, as a frame has them."""


@dataclass(slots=True)
class _Known:
    """The known state of a robot."""

    since: int  # the tick of its last frame or, where that is not known to be its process's, of the process's start
    last: Position | None = None  # that frame's position; None where the process may not know it


class DueFrames:
    """Finds frames that are missing in lockstep, where the world waits for all that a robot has to say.

    All robots send in each tick unless the fleet saves on its radio. A robot that may not send in each tick is due when
    it wants to send for sure, and must have earned the longest frame since its last; where it sees an intruder, all
    that it can save. It may send earlier, so this says nothing about frames that are not missing.
    """

    def __init__(self, scenario: Scenario, terrain: Terrain) -> None:
        """Begin before the first tick."""
        radio, share = scenario.radio, scenario.radio_share
        self._always = not radio.spares_frames
        self._silence = radio.silence_ticks(scenario.step)
        self._error = None if radio.adaptive is None else radio.adaptive.error
        self._earns_in = (0, 0) if share is None else (share.earns_frame_in, share.earns_most_in)
        self._predictor = Predictor(terrain, radio.trail_every, self._silence)
        self._known: dict[int, _Known] = {}

    def missing(
        self,
        k: int,
        living: Mapping[int, Position],
        sent: Mapping[int, Position],
        seers: Collection[int],
        interrupted: Collection[int | None],
    ) -> list[int]:
        """Return the numbers of the robots that should have sent a frame in a tick and have not.

        Ticks are asked about in turn. `living` says where each living robot takes itself to be, `seers` which robots
        see an intruder, and `interrupted` which had an event since the tick before: their processes may be other ones.
        """
        silent = [number for number in living if number not in sent]
        if self._always:
            return silent
        remaining = {number: last_known for number, last_known in self._known.items() if number not in interrupted}
        # An event may mean another process, which knows nothing of the last frame.
        self._known = {number: remaining.get(number, _Known(k)) for number in living}
        for number, position in sent.items():
            self._known[number] = _Known(k, position)
        return [n for n in silent if self._due(self._known[n], living[n], sees=n in seers)]

    def _due(self, known: _Known, now: Position, *, sees: bool) -> bool:
        silent = now.sequence - known.since
        # False counts as 0 and True as 1: the time for one frame, or for all that can be saved.
        if silent < self._earns_in[sees]:
            return False
        if self._error is None or silent >= self._silence:
            return True
        return known.last is not None and self._predictor.error(known.last, now) > self._error


class FramesAreTrue(Check):
    """A sender's first frame gives the place that it takes itself to be at, as the wire has it, and its trail.

    Each of its other frames reports an intruder that its footprint covers, and none twice. In lockstep, where the world
    waits for all that a robot has to say, none of these may be missing but from a robot that is lost in that tick.
    Where the fleet saves on its radio, `DueFrames` holds the rules for positions; contacts come with a position, and
    may be left out where there is a budget.
    Where the fleet has a key and it can be read, each frame carries its tag. Forged frames have their own check.
    """

    name = "frames"

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        prepared, scenario = run.prepared, run.prepared.scenario
        self._waits = scenario.factor is None
        self._intruders = Intruders(scenario, run.reading(ClosedGround).footprint)
        self._senses = Senses(scenario, run.timeline, prepared.terrain)
        self._places: dict[int, OwnPlace] = {}
        self._moves: dict[int, tuple[Command, bool]] = {}  # of the tick before, and whether they were cancelled
        # Where the world may slow, or go on with, another command than the robot has given, places are not exact.
        self._exact = self._waits and not any(zone.speed is not None for zone in scenario.zones)
        self._most_off: dict[int, float] = defaultdict(float)  # largest error of a robot's localisation so far, m
        self._due = DueFrames(scenario, prepared.terrain)
        self._sparing = scenario.radio.spares_frames
        self._in_budget = scenario.radio.budget is not None
        self._every = scenario.radio.trail_every
        places = MAX_TRAIL * self._every + 1
        self._tracks = {number: deque[tuple[int, int]](maxlen=places) for number in run.names}
        self._key: bytes | None = None
        self._unknown_key = ""
        try:
            self._key = fleet_key(scenario.radio.key)
        except BadInput as bad:
            self._unknown_key = f"{TAGS_NOT_JUDGED}{bad}"
        self._missing: list[tuple[int, int, str]] = []

    def _tick(self, record: TickRecord) -> None:
        # Only now does the journal show which robots were lost in the tick before.
        self._find_missing()
        if self._problem:
            return
        expected: dict[int, Position] = {}
        sent: dict[int, Position] = {}
        contacts: dict[int, list[Position]] = {}
        events = self._events_before(record.k)
        for event in events:
            if event.kind == "dead":  # a restart may begin another process in the same tick
                self._places.pop(event.robot or NO_ROBOT, None)
        for row in record.robots:
            true = Pose(row.x, row.y, row.heading)
            time_s = self._senses.clock(row.number, record.k)
            believed = self._believed_pose(row, record.k, true)
            position = Position.of(row.number, record.k, time_s, believed)
            # Newest first, as in a trail.
            self._tracks[row.number].appendleft((position.x_cm, position.y_cm))
            if row.status is Status.ALIVE:
                expected[row.number] = position
                places = self._intruders.seen_by(record.k, true)
                contacts[row.number] = [Position.of_contact(record.k, time_s, *spot) for spot in places]
        for source, frame in record.frames:
            if source == FORGED:
                continue
            if source not in contacts or source not in sent:
                problem = self._problem_of(source, frame, expected.get(source), sent)
            else:
                problem = _problem_of_contact(frame, self._key, contacts[source])
            if problem:
                self._fail(f"frame {record.k} of {self._name(source)} {problem}")
                return
            self._looked += 1
        if self._waits:
            seers = [number for number, reports in contacts.items() if reports]
            interrupted = {event.robot for event in events}
            silent = self._due.missing(record.k, expected, sent, seers, interrupted)
            self._missing = [(record.k, number, "its position") for number in silent]
            self._missing += [(record.k, number, "a contact") for number in self._without_contact(contacts, sent)]

    def _end(self) -> str:
        self._find_missing()
        return f"{self._looked} frames agree with the truth{self._unknown_key}"

    def _believed_pose(self, row: RobotTick, k: int, true: Pose) -> Pose:
        """Return the pose that a robot believes in at tick k, which the record of the tick before leads to."""
        localised = self._senses.pose(row.number, k, true)
        if row.status is not Status.ALIVE:  # after which its place begins anew
            return localised
        own = self._places.setdefault(row.number, OwnPlace(self._step))
        last, bumped = self._moves.get(row.number, (halted(self._run.specs[row.number].model), False))
        self._moves[row.number] = self._run.command(row), row.bumped
        off_m = math.hypot(localised.x - true.x, localised.y - true.y)
        self._most_off[row.number] = max(self._most_off[row.number], off_m)
        return own.take(k, localised, last, bumped)

    def _find_missing(self) -> None:
        """Find frames that were missing in the last tick; whether their senders were lost in it is known only now."""
        for k, number, frame in () if self._problem else self._missing:
            if number not in self._run.lost_in(k):
                self._fail(f"{self._name(number)} did not send {frame} in tick {k}")
                return

    def _without_contact(self, unreported: Mapping[int, list[Position]], sent: Mapping[int, Position]) -> list[int]:
        """Return the robots that have left out a contact and should not have."""
        if self._in_budget:
            return []
        return [number for number, contacts in unreported.items() if contacts and (number in sent or not self._sparing)]

    def _problem_of(self, source: int, frame: bytes, due: Position | None, sent: dict[int, Position]) -> str:
        """Describe the error of a position, and add it to those sent."""
        if due is None:
            return "has no sender that is alive"
        # Comparing bytes is faster than decoding them, and nearly all frames have no trail.
        if frame == encode(due, self._key):  # nearly always, without a trail
            sent[source] = due
            return ""
        try:
            position = sent[source] = decode(frame, self._key)
        except Rejected as rejected:
            return f"cannot be decoded ({rejected})"
        if position.trail:
            track = list(self._tracks[source])[:: self._every][: len(position.trail) + 1]
            due = replace(due, trail=tuple((old[0] - new[0], old[1] - new[1]) for new, old in pairwise(track)))
        if not self._exact and self._is_near(position, due):
            # What it has sent is what later frames repeat as their trail.
            self._tracks[source][0] = position.x_cm, position.y_cm
            return ""
        return "" if position == due else f"says {position}; the pose gives {due}"

    def _is_near(self, said: Position, due: Position) -> bool:
        """Return True if a place is as due but for filtering by other commands, which errors of localisation bound."""
        off_cm = math.hypot(said.x_cm - due.x_cm, said.y_cm - due.y_cm)
        is_same = replace(said, x_cm=due.x_cm, y_cm=due.y_cm, trail=due.trail) == due
        return is_same and 0.0 < off_cm <= m_to_cm(2.0 * self._most_off[said.robot])


def _problem_of_contact(frame: bytes, key: bytes | None, due: list[Position]) -> str:
    """Describe the error of a contact's report, and remove the contact from those that are due."""
    try:
        contact = decode(frame, key)
    except Rejected as rejected:
        return f"cannot be decoded ({rejected})"
    if contact not in due:
        return f"reports {contact}, but its sender sees no such intruder"
    # Each contact may be reported once.
    due.remove(contact)
    return ""


class WithinBudget(Check):
    """No robot has sent more than its share of `radio.budget`, and no frame was too long.

    A share is saved up for a second or a step, or until it holds the longest frame and a contact, whichever is more.
    The fleet begins with nothing saved, so at no time has it sent more than the budget times the time so far. Bits
    count as on the air, with the radio's overhead. Forged frames are not the robots', nor are copies that a fault made.
    """

    name = "budget"
    needs_no_robots = True

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        scenario = run.prepared.scenario
        budget = scenario.radio.budget
        assert budget is not None
        self._budget = budget
        self._per_s = budget.bits_per_s / len(scenario.roster)
        tagged = scenario.radio.key is not None
        two_frames = scenario.radio.longest_frame + longest_frame(0, tagged=tagged) + 2 * budget.overhead
        self._most = max(self._per_s * max(self._step, 1.0), float(BITS * two_frames))
        self._left = dict.fromkeys(run.names, 0.0)
        self._ticks = self._bits = self._longest = self._peak = 0
        self._window: deque[int] = deque(maxlen=max(1, round(WINDOW_S / self._step)))

    @classmethod
    def applies(cls, run: JudgedRun) -> bool:
        """Return True if the scenario has a budget."""
        return run.prepared.scenario.radio.budget is not None

    def _tick(self, record: TickRecord) -> None:
        # Nothing is saved before the first tick.
        if self._ticks:
            earned = self._per_s * self._step
            self._left = {number: min(allowance + earned, self._most) for number, allowance in self._left.items()}
        self._ticks += 1
        bits = 0
        for source, frame in record.frames:
            if source not in self._left:  # forged
                continue
            cost = BITS * (len(frame) + self._budget.overhead)
            bits += cost
            self._longest = max(self._longest, len(frame))
            # Before the comparison: a robot may use all that it has, to the bit.
            self._left[source] -= cost
            name, frame_limit = self._name(source), self._budget.frame
            if len(frame) > frame_limit:
                self._fail(f"{name} sent {len(frame)} bytes in tick {record.k}, at most {frame_limit} are allowed")
            elif self._left[source] < -ROUNDING_BITS:
                excess = f"{-self._left[source]:.0f} bits more than its share of {self._per_s:g} bit/s"
                self._fail(f"{name} had sent {excess} by tick {record.k}")
        self._bits += bits
        self._window.append(bits)
        self._peak = max(self._peak, sum(self._window))

    def _end(self) -> str:
        used = self._bits / (self._ticks * self._step) if self._ticks else 0.0
        peak = self._peak / (len(self._window) * self._step) if self._window else 0.0
        return (
            f"{used:.0f} of {self._budget.bits_per_s:g} bit/s used, at most {peak:.0f} in {WINDOW_S:g} s; "
            f"the longest frame has {self._longest} of {self._budget.frame} bytes"
        )


class SpoofsAsAsked(Check):
    """Each active spoof sends one frame in each victim's name, or one for each robot it invents, with its payload.

    Nothing else is forged: not before or after the fault, not by a robot that is not alive, not in the name of a robot
    of which nothing can be said yet. `offset`, `freeze` and `ahead` are compared with the victim's own frame of the
    tick; where it sends none, with its true place, unless a drift makes it wrong about that.
    """

    name = "forgeries"
    kinds = (Spoof,)
    of_ether = True

    def __init__(self, run: JudgedRun) -> None:
        super().__init__(run)
        self._robots = len(run.prepared.scenario.roster)
        self._spares = run.prepared.scenario.spares
        self._bounds = run.prepared.terrain.bounds
        self._drifts = run.entries(Drift)
        self._age = {entry.id: _count_ticks(_read_field(entry, "replay") or 0.0, run.step) for entry in self._entries}
        # The first frame of each source, the newest tick first.
        self._sent: deque[Mapping[int, bytes]] = deque(maxlen=1 + max(self._age.values()))
        self._frozen: dict[tuple[str, int], Place] = {}
        self._forged = 0

    def _tick(self, record: TickRecord) -> None:
        frames = [frame for source, frame in record.frames if source == FORGED]
        forged: dict[str, list[bytes]] = defaultdict(list)
        for fault, frame in zip(record.forged, frames, strict=False):
            forged[fault].append(frame)
        if len(frames) != len(record.forged):
            self._fail_tick(
                record.k, f"{len(frames)} forged frames, but the record names faults for {len(record.forged)}"
            )
        # Reversed, so that of several frames of a source the first one stays.
        self._sent.appendleft(dict(reversed(record.frames)))
        self._forged += len(frames)
        rows = {row.number: row for row in record.robots}
        for entry in self._entries:
            origin, sent = entry.sources[0], forged.pop(entry.id, [])
            if active(entry, record.k) and (origin == NO_ROBOT or rows[origin].status is Status.ALIVE):
                problem = self._problem_of(entry, record.k, sent, rows)
            else:
                problem = "sends forged frames and should not" if sent else ""
            if problem:
                self._fail_tick(record.k, f"{entry.id} {problem}")
        for fault in forged:
            self._fail_tick(record.k, f"{fault} sends forged frames and is not a spoof")

    def _end(self) -> str:
        return f"{self._forged} frames forged as configured"

    def _problem_of(self, entry: Entry, k: int, frames: list[bytes], rows: Mapping[int, RobotTick]) -> str:
        """Describe errors in the frames that an active spoof sends in a tick."""
        if _read_field(entry, "replay") is not None:
            age = self._age[entry.id]
            old = self._sent[age] if age < len(self._sent) else {}
            repeated = sorted(old[number] for number in self._known(entry, rows) if number in old)
            return "" if sorted(frames) == repeated else f"does not repeat what its victims sent {age} ticks ago"
        expected = list(self._due(entry, rows))
        try:
            positions = sorted((decode(frame) for frame in frames), key=lambda position: position.robot)
        except Rejected as rejected:
            return f"sends a frame that cannot be decoded ({rejected})"
        names = [position.robot for position in positions]
        if names != expected:
            return f"forges in the names of robots {names} instead of {expected}"
        for position in positions:
            problem = self._problem_of_one(entry, k, position, rows.get(position.robot))
            if problem:
                return f"claims for robot {position.robot}: {problem}"
        return ""

    def _known(self, entry: Entry, rows: Mapping[int, RobotTick]) -> Iterator[int]:
        """Yield the victims without the spare robots that have not joined yet."""
        return (n for n in entry.who if rows[n].status is not Status.ABSENT or n not in self._spares)

    def _due(self, entry: Entry, rows: Mapping[int, RobotTick]) -> Iterator[int]:
        """Yield the robots to forge, ascending: victims whose place is known, or robots that do not exist."""
        if (invented := _read_field(entry, "invented")) is not None:
            yield from range(self._robots + 1, min(self._robots + invented, MAX_ROBOT) + 1)
            return
        for number in self._known(entry, rows):
            if _has_payload(entry, "random") or (entry.id, number) in self._frozen or rows[number].status.is_present:
                yield number

    def _problem_of_one(self, entry: Entry, k: int, position: Position, victim: RobotTick | None) -> str:
        """Describe the error of a forged position that is no replay; `victim` is None for a robot that is invented."""
        sequence = k + (_read_field(entry, "ahead") or 0)
        if position.sequence != sequence:
            return f"sequence {position.sequence} instead of {sequence}"
        sent = None if victim is None else self._sent_by(victim.number)
        stamp = position.time_ms if sent is None else sent.time_ms
        if victim is None:
            stamp = min(round(s_to_ms(k * self._step)), MAX_TIME_MS)
        if position.time_ms != stamp:
            return f"time {position.time_ms} ms instead of {stamp} ms"
        pose = (position.x_cm, position.y_cm, position.heading_mrad)
        if victim is None or _has_payload(entry, "random"):
            return "" if self._on_terrain(position) else f"place {pose}, which is off the terrain"
        if _has_payload(entry, "freeze"):
            frozen = self._frozen.get((entry.id, position.robot))
            if frozen is not None:
                return "" if pose == frozen else f"place {pose}, but it was frozen at {frozen}"
            self._frozen[entry.id, position.robot] = pose
        is_honest = victim.number not in robots_hit(self._drifts, k)
        offset = _read_field(entry, "offset") or (0.0, 0.0)
        is_right = _is_shifted(pose, victim, sent, offset, is_honest)
        return "" if is_right else f"place {pose}, not its own plus the offset"

    def _sent_by(self, number: int) -> Position | None:
        """Return the position that a robot has sent itself in this tick; None if it sent none."""
        try:
            return decode(self._sent[0][number]) if number in self._sent[0] else None
        except Rejected:
            return None

    def _on_terrain(self, position: Position) -> bool:
        x_min, y_min, x_max, y_max = (m_to_cm(bound) for bound in self._bounds)
        across = x_min - _HALF_CM <= position.x_cm <= x_max + _HALF_CM
        return across and y_min - _HALF_CM <= position.y_cm <= y_max + _HALF_CM

    def _fail_tick(self, k: int, problem: str) -> None:
        self._fail(f"tick {k}: {problem}")


def _read_field(entry: Entry, field: str) -> Any:
    """Return a field that a spoof sets in its frames; None where it asks for something else."""
    return getattr(entry.fault.payload, field, None) if isinstance(entry.fault, Spoof) else None


def _has_payload(entry: Entry, payload: str) -> bool:
    return isinstance(entry.fault, Spoof) and entry.fault.payload == payload


def _count_ticks(seconds: float, step: float) -> int:
    """Return the least number of whole ticks, at least one, that is not less than a time; 0 for no time.

    For example, 3 for 1.2 s with steps of 0.5 s, and 2 for 1.0 s.
    """
    # Rounding must not add a tick to a time that is a whole number of them.
    near = max(round(seconds / step), 1)
    return (near if near * step >= seconds - 1e-9 * step else near + 1) if seconds else 0


def _is_shifted(
    place: Place, victim: RobotTick, sent: Position | None, offset: tuple[float, float], is_honest: bool
) -> bool:
    """Return True if a place is the victim's, shifted by an offset (m), as far as the wire's rounding can tell."""
    x, y, heading = place
    if sent is not None:
        # Both its own place and the shifted one were rounded.
        near = 2.0 * _HALF_CM if any(offset) else 0.0
        own_x, own_y, same = float(sent.x_cm), float(sent.y_cm), heading == sent.heading_mrad
    else:
        near, same = _HALF_CM if is_honest else math.inf, True
        own_x, own_y = m_to_cm(victim.x), m_to_cm(victim.y)
    return same and abs(x - own_x - m_to_cm(offset[0])) <= near and abs(y - own_y - m_to_cm(offset[1])) <= near
