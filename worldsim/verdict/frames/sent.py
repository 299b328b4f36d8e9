"""The verdict's checks of sent frames: they agree with the truth, and each of them is accounted for."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from patrol.errors import BadInput
from patrol.journal import Status, TickRecord
from patrol.journal.links import Links, drops_of, joined, links_of, places_of
from patrol.journal.records import FORGED
from patrol.pose import Pose
from patrol.radio.fleet_key import fleet_key
from patrol.radio.message import MAX_TRAIL, Position, Rejected, decode, encode
from worldsim.robots.intruders import Intruders
from worldsim.robots.senses import Senses
from worldsim.verdict.common.check import TAGS_NOT_JUDGED, Check, CheckResult
from worldsim.verdict.common.closed_ground import ClosedGround
from worldsim.verdict.common.robots_there import RobotsThere
from worldsim.verdict.frames.airborne import sent_links
from worldsim.verdict.frames.due import DueFrames
from worldsim.verdict.frames.recomputed import FatesAsRecomputed

if TYPE_CHECKING:
    from collections.abc import Mapping

    from worldsim.verdict.common.check import JudgedRun, Readings

_LOST = Status.LOST.name.lower()


class FramesAreTrue(Check):
    """A sender's first frame gives the place that it takes itself to be at, as the wire has it, and its trail.

    Each of its other frames reports an intruder that its footprint covers, and none twice. In lockstep, where the world
    waits for all that a robot has to say, none of these may be missing but from a robot that is lost in that tick.
    Where the fleet saves on its radio, `due.py` holds the rules for positions; contacts come with a position, and may
    be left out where there is a budget.
    Where the fleet has a key and it can be read, each frame carries its tag. Forged frames have their own check.
    """

    name = "frames"
    needs = (RobotsThere, ClosedGround)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        prepared, scenario = run.prepared, run.prepared.scenario
        self._waits = scenario.factor is None
        self._names = run.names
        self._intruders = Intruders(scenario, readings[ClosedGround].footprint)
        self._senses = Senses(scenario, run.timeline, prepared.terrain)
        self._due = DueFrames(scenario, prepared.terrain, run.journal)
        self._sparing = scenario.radio.spares_frames
        self._in_budget = scenario.radio.budget is not None
        self._every = scenario.radio.trail_every
        places = MAX_TRAIL * self._every + 1
        self._tracks = {number: deque[tuple[int, int]](maxlen=places) for number in self._names}
        self._key: bytes | None = None
        self._unknown_key = ""
        try:
            self._key = fleet_key(scenario.radio.key)
        except BadInput as bad:
            self._unknown_key = f"{TAGS_NOT_JUDGED}{bad}"
        self._missing: list[tuple[int, int, str]] = []
        self._looked = 0

    def _tick(self, record: TickRecord) -> None:
        self._miss()
        if self._problem:
            return
        due: dict[int, Position] = {}
        sent: dict[int, Position] = {}
        contacts: dict[int, list[Position]] = {}
        for row in record.robots:
            true = Pose(row.x, row.y, row.heading)
            time_s = self._senses.clock(row.number, record.k)
            believed = self._senses.pose(row.number, record.k, true)
            position = Position.of(row.number, record.k, time_s, believed)
            self._tracks[row.number].appendleft((position.x_cm, position.y_cm))
            if row.status is Status.ALIVE:
                due[row.number] = position
                places = self._intruders.seen_by(record.k, true)
                contacts[row.number] = [Position.of_contact(record.k, time_s, *place) for place in places]
        for source, frame in record.frames:
            if source == FORGED:
                continue
            if source not in contacts or source not in sent:
                problem = self._problem_of(source, frame, due.get(source), sent)
            else:
                problem = _problem_of_contact(frame, self._key, contacts[source])
            if problem:
                self._fail(f"frame {record.k} of {self._names.get(source, source)} {problem}")
                return
            self._looked += 1
        if self._waits:
            seers = [number for number, reports in contacts.items() if reports]
            silent = self._due.missing(record.k, due, sent, seers)
            self._missing = [(record.k, number, "its position") for number in silent]
            self._missing += [(record.k, number, "a contact") for number in self._without_contact(contacts, sent)]

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in and the journal has ended."""
        self._miss()
        return super().result()

    def _good(self) -> str:
        return f"{self._looked} frames agree with the truth{self._unknown_key}"

    def _miss(self) -> None:
        """Find frames that were missing in the last tick; whether their senders were lost in it is known only now."""
        for k, number, frame in () if self._problem else self._missing:
            if not any(e.k == k + 1 and e.robot == number and e.kind == _LOST for e in self._run.journal.events):
                self._fail(f"{self._names[number]} did not send {frame} in tick {k}")
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
        return "" if position == due else f"says {position}; the pose gives {due}"


class LinksAddUp(Check):
    """On every directed link each frame sent, copies included, was delivered or dropped once, or is still in flight.

    Nothing else was delivered or dropped. `FatesAsRecomputed` says what is in flight at the end.
    """

    name = "links add up"
    of_ether = True
    needs = (FatesAsRecomputed,)

    def __init__(self, run: JudgedRun, readings: Readings) -> None:
        super().__init__(run, readings)
        self._names = run.senders
        self._recomputed = readings[FatesAsRecomputed]
        self._sent = self._settled = 0
        self._open: Counter[tuple[int, int, int]] = Counter()

    def _tick(self, record: TickRecord) -> None:
        links = sent_links(record)
        settled = joined(links_of(record.deliveries), drops_of(record.dropped))
        self._sent += len(links) + len(record.copies)
        self._settled += len(settled)
        if not record.copies and _same_links(links, settled):
            return
        self._open.update(links)
        self._open.update(copy[:3] for copy in record.copies)
        for link in settled:
            self._open[link] -= 1
            if self._open[link] == 0:
                del self._open[link]

    def result(self) -> CheckResult:
        """Return the result, once all ticks are in."""
        wrong = Counter(self._open)
        wrong.subtract(self._recomputed.in_flight)
        wrong = Counter({link: left for link, left in wrong.items() if left})
        if wrong:
            (source, destination, sequence), left = min(wrong.items())
            link = f"{self._names.get(source, source)} to {self._names.get(destination, destination)}"
            problem = "neither delivered nor dropped" if left > 0 else "delivered or dropped but not sent"
            self._fail(f"frame {sequence} from {link} was {problem} ({len(wrong)} such frames)")
        return super().result()

    def _good(self) -> str:
        flying = f", {self._open.total()} in flight" if self._open else ""
        return f"{self._sent} frames sent over links, {self._settled} delivered or dropped{flying}"


def _same_links(links: Links, others: Links) -> bool:
    """Return True if two lists hold the same links, each as often, in any order."""
    if len(links) != len(others):
        return False
    if links == others:
        return True
    mine, theirs = places_of(links), places_of(others)
    if mine is None or theirs is None:
        return False
    return np.array_equal(np.sort(mine), np.sort(theirs))


def _problem_of_contact(frame: bytes, key: bytes | None, due: list[Position]) -> str:
    """Describe the error of a contact's report, and remove the contact from those that are due."""
    try:
        contact = decode(frame, key)
    except Rejected as rejected:
        return f"cannot be decoded ({rejected})"
    if contact not in due:
        return f"reports {contact}, but its sender sees no such intruder"
    due.remove(contact)
    return ""
