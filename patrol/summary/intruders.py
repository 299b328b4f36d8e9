"""A run's intruders, reported and surrounded: from the journal into the summary, and from there to people."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from patrol.journal.records import FORGED, SURROUNDING, Status
from patrol.radio.message import CONTACT, Position, Rejected, decode
from patrol.scenario import load_scenario
from patrol.scenario.controls import OPERATOR, intruder_name, intruders_came, operated
from patrol.summary.metric import FiguresTable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from patrol.journal.records import Event, Header, TickRecord
    from patrol.scenario import Scenario
    from patrol.summary.model import Summary

BESIDE = 1.5
"""A robot that surrounds an intruder stands at it within this many times `patrol.surround_distance`."""

RING = 2
"""Robots that have to stand around an intruder for it to be surrounded."""


@dataclass(slots=True)
class _Intruder:
    place: tuple[float, float]
    at_s: float
    until_s: float | None
    first_reported: int | None = None
    reported: int = 0
    surrounded: int = 0
    most_robots: int = 0

    def is_there(self, time_s: float) -> bool:
        return self.at_s <= time_s and (self.until_s is None or time_s < self.until_s)

    def facts(self, step: float) -> dict[str, Any]:
        first = self.first_reported
        return {
            "place_m": list(self.place),
            "at_s": self.at_s,
            "until_s": self.until_s,
            "first_reported_s": None if first is None else first * step,
            "reported_s": self.reported * step,
            "surrounded_s": self.surrounded * step,
            "most_robots": self.most_robots,
        }


class IntruderTotals:
    """Follows the intruders of a run tick by tick; see `figures`."""

    def __init__(self, header: Header, events: Sequence[Event]) -> None:
        """Start before the first tick; the events are all of the run, as operators may have added intruders."""
        self._step = float(header.scenario["step"])
        self._intruders: list[_Intruder] = []
        self._beside = 0.0
        if header.scenario.get("intruders") or any(event.kind == OPERATOR for event in events):
            self._expect_intruders(operated(load_scenario(header.scenario), events))

    def _expect_intruders(self, scenario: Scenario) -> None:
        self._beside = BESIDE * scenario.lengths[scenario.roster[0].number].surround_distance
        for spec in scenario.intruders:
            until_s = None if spec.stay is None else spec.at + spec.stay
            self._intruders.append(_Intruder(spec.place, spec.at, until_s))

    def tick(self, record: TickRecord) -> None:
        """Take in the next tick."""
        present = [intruder for intruder in self._intruders if intruder.is_there(record.k * self._step)]
        if not present:
            return
        reported = {
            id(nearest): nearest for nearest in (_nearest_intruder(present, spot) for spot in _contact_places(record))
        }
        # By identity: several robots may report the same intruder in one tick, which counts once.
        for intruder in reported.values():
            intruder.reported += 1
            if intruder.first_reported is None:
                intruder.first_reported = record.k
        places = [(row.x, row.y) for row in record.robots if row.status is Status.ALIVE and row.state == SURROUNDING]
        for intruder in present:
            around = sum(
                math.dist(spot, intruder.place) <= self._beside and _nearest_intruder(present, spot) is intruder
                for spot in places
            )
            intruder.most_robots = max(intruder.most_robots, around)
            intruder.surrounded += around >= RING

    def figures(self, events: Sequence[Event]) -> dict[str, Any]:
        """Return the summary's entry `intruders`, or nothing for a run without any.

        Per intruder: `place_m`; `at_s` and `until_s`, when it comes and goes (None: it stays to the end);
        `first_reported_s`, when a robot first reported it (None: never); `reported_s`, for how long one did;
        `surrounded_s`, for how long at least `RING` robots stood around it; `most_robots`, how many did at most.
        """
        del events
        if not self._intruders:
            return {}
        return {"intruders": [intruder.facts(self._step) for intruder in self._intruders]}


def intruder_lines(summary: Summary) -> list[str]:
    """Describe how many intruders were reported and how soon, and for how long they were surrounded."""
    intruders = summary.intruders
    if not intruders:
        return []
    reported = [(facts.first_reported_s, facts) for facts in intruders if facts.first_reported_s is not None]
    text = f"intruders   {len(reported)} of {len(intruders)} found"
    if not reported:
        return [text]
    first_s, first = min(reported, key=lambda pair: pair[0])
    text += f", the first at {first_s:g} s, {first_s - first.at_s:g} s after it came"
    surrounded_s = sum(facts.surrounded_s for _, facts in reported)
    if not surrounded_s:
        return [f"{text}; never surrounded"]
    robots = max(facts.most_robots for _, facts in reported)
    return [f"{text}; surrounded for {surrounded_s:g} s, by at most {robots} robots"]


def intruder_table(summary: Summary, scenario: Scenario, end_s: float) -> FiguresTable:
    """Return the place and time of each intruder that came, its report, and how it was surrounded."""
    facts = dict(enumerate(summary.intruders))
    rows = []
    for index, begin_s, gone_s in intruders_came(scenario, end_s):
        numbers = ("-", "-", "-", "-")
        if counted := facts.get(index):
            first = counted.first_reported_s
            reported = "never" if first is None else f"{first:g}"
            numbers = (reported, f"{counted.reported_s:g}", f"{counted.surrounded_s:g}", f"{counted.most_robots}")
        x, y = scenario.intruders[index].place
        rows.append((intruder_name(index), f"at ({x:g}, {y:g})", f"{begin_s:g}", f"{gone_s:g}", *numbers))
    heads = ("intruder", "place (m)", "from (s)", "to (s)", "first reported at (s)", "reported for (s)")
    return FiguresTable((*heads, "surrounded for (s)", "robots around it at most"), rows, range(2, 8))


def _nearest_intruder(intruders: Sequence[_Intruder], place: tuple[float, float]) -> _Intruder:
    return min(intruders, key=lambda intruder: math.dist(intruder.place, place))


def _contact_places(record: TickRecord) -> list[tuple[float, float]]:
    """Return the places of the intruders that robots report in a tick, m; a robot's contacts follow its position."""
    places = []
    earlier = FORGED
    for source, frame in record.frames:
        # The first frame of a source is its position, and what follows from the same source its contacts.
        if source == earlier != FORGED and (position := _read_frame(frame)) is not None and position.robot == CONTACT:
            places.append((position.pose.x, position.pose.y))
        earlier = source
    return places


def _read_frame(frame: bytes) -> Position | None:
    try:
        return decode(frame)
    except Rejected:
        return None
