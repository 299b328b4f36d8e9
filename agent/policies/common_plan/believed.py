"""Drawing stations by what is believed: all robots hear each other, and so find the same without a word.

Every robot works out the parts of all. All believe nearly the same fog, hear where the others are, and draw the same
numbers, so each can work out what *all* will do, and take its own part. What happens is taken into account at once,
such as a robot that charges, or a closed door.

*Agreeing again*: a lost position makes robots believe different things. So a draw stays the same for a while, and a
robot that is seen to go elsewhere than was worked out is worked out anew. At the begin of a period, and whenever other
robots are heard, all begin from where the robots are. Where many positions are lost, that is not enough
(`agent.policies.common_plan.following`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from agent.policies.common_plan.drawing import SPELL, Drawing, Parts
from agent.policies.common_plan.stations import StationAges
from agent.policies.pursuit import Target, age_of
from patrol.radio.peers import columns_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from agent.policies.commitment import Choice
    from agent.policies.common_plan.drawing import Leads, Part
    from agent.policies.common_plan.stations import Ages, Group, KnownStations
    from agent.policies.pursuit import GivenUp, Pursuit
    from agent.ports import PolicySetup
    from agent.routes.routes import Element, Way
    from agent.view import View
    from patrol.tours.round import Flat, Round

TURNED = 0.4
"""A robot whose way to its station has become so much longer again, in ranges of the sensor, has drawn another one."""


@dataclass(slots=True, eq=False)
class FleetParts:
    """The parts of all robots as of one tick. Robots of one process that have worked out the same ones share them."""

    drawing: Drawing | None = None  # None before the first tick
    parts: Parts = field(default_factory=Parts)
    period: int = -1


NO_PARTS = FleetParts()


class RoundStands:
    """The stands of one robot for the points of a round.

    A point is seen from its place on the round. Where that is given up, or no way leads there now, it may be seen from
    the point itself, or from its post where no body fits.
    """

    def __init__(self, setup: PolicySetup, laid_out: Round) -> None:
        """Find the point itself, or its post, for each point of the round."""
        own_stands = setup.ground.fields.stands_for(laid_out.points)
        self._round = laid_out
        self._own = np.where(own_stands >= 0, own_stands, laid_out.stands)
        self._width = setup.ground.terrain.width

    def of(self, view: View, given_up: GivenUp, span: slice) -> tuple[Flat, NDArray[np.bool_]]:
        """Return the flat indices from which to see some of `Round.points` now, and which of them are usable.

        Usable are those that the robot gets to and has not given up.
        """
        stands, own_stands = self._round.stands[span], self._own[span]
        usable = np.ones(stands.shape, dtype=np.bool_)
        if (now := view.fog.stands) is not None:
            own_stands = now[self._round.points[span]]
            usable = own_stands >= 0
            stands = np.where(now[stands] == stands, stands, own_stands)
        if given_up.now(view.tick).size:
            stands = np.where(given_up.covers(view.tick, stands, self._width), own_stands, stands)
            usable &= ~given_up.covers(view.tick, stands, self._width)
        return stands, usable


class Believed:
    """The choice of one robot's stations by what it believes."""

    def __init__(self, setup: PolicySetup, laid_out: Round, free: Choice) -> None:
        """Begin without a station."""
        self._setup, self._free = setup, free
        self._stands = RoundStands(setup, laid_out)
        self._fleet = NO_PARTS
        # What the robots of one process have worked out in a tick, by all that it follows from.
        self._worked_out: dict[int, dict[tuple[object, ...], FleetParts]] = setup.ground.scratch.setdefault("parts", {})
        self._known: KnownStations | None = None
        self._ages: StationAges | None = None
        self._number, self._step = setup.robot.spec.number, setup.fleet.step
        self._width = setup.ground.terrain.width
        turned_m = TURNED * setup.ground.sight.range_m
        self._turned_s = {spec.number: turned_m / spec.speed for spec in setup.fleet.roster}
        regular = [spec.speed for spec in setup.fleet.roster if not spec.spare]
        self._spell_s = SPELL * laid_out.length_m / sum(regular)

    def forget(self) -> None:
        """Begin anew at the next tick."""
        self._fleet = NO_PARTS

    def note(self, view: View, pursuit: Pursuit, group: Group) -> bool:
        """Draw the next station of each robot that has seen its own; return True if none is left for this one."""
        before = self._station
        if group.known is not self._known:
            self._known, self._ages, self._fleet = group.known, StationAges(group.known, self._step), NO_PARTS
        self._go_on(view, group)
        if (station := self._station) != before:
            pursuit.target = None
        return station is None

    def next(self, view: View, start: Element, pursuit: Pursuit) -> Way | None:
        """Commit to the oldest point of the robot's station, and return the way there, or that of a free choice."""
        if (station := self._station) is not None:
            visit = self._visit(view, station, pursuit.given_up)
            if visit is not None and (way := pursuit.go_to(view, start, visit)) is not None:
                return way
        # No way leads there now. Another robot may stand in the door, and the two would wait for each other.
        return self._free.next(view, start, pursuit)

    @property
    def _station(self) -> int | None:
        own_part = self._fleet.parts.each.get(self._number)
        return own_part.route[0] if own_part is not None and own_part.route else None

    def _visit(self, view: View, station: int, given_up: GivenUp) -> Target | None:
        """Return the oldest point of a station that the robot has not given up; None where there is none."""
        known = self._known
        assert known is not None
        span = known.span(station)
        ages = self._ages_of(view, span)
        stands, usable = self._stands.of(view, given_up, slice(known.first + span.start, known.first + span.stop))
        # Below every age, so that no stand that is not usable is chosen.
        ages[~usable] = -1.0
        oldest = int(ages.argmax())
        if ages[oldest] < 0.0:
            return None
        point = divmod(int(known.points[span][oldest]), self._width)
        stand = int(stands[oldest])
        heading = known.heading_of(span.start + oldest, stand)
        return Target(point, divmod(stand, self._width), max(age_of(view, point), 1), heading=heading)

    def _ages_of(self, view: View, some: slice) -> Ages:
        assert self._ages is not None
        return self._ages.of_points(some, view.tick, view.fog.patrolled, view.fog.last_seen)

    def _go_on(self, view: View, group: Group) -> None:
        # A peer as an object takes longer than all that is asked of it here.
        peers = columns_of(view.peers)
        rows = np.isin(peers.numbers, list(group.robots))
        others = zip(peers.numbers[rows].tolist(), peers.places[rows].tolist(), strict=True)
        poses = {number: (x, y, 0.0) for number, (x, y) in others}
        poses[self._number] = view.reported.x, view.reported.y, 0.0
        if group.known.turns is not None:
            headings = {number: view.peers[number].pose.heading for number in poses.keys() - {self._number}}
            headings[self._number] = view.reported.heading
            poses = {number: (x, y, headings[number]) for number, (x, y, _) in poses.items()}
        robots = tuple(sorted(poses))
        spots = [poses[number] for number in robots]
        question = view.fog.identity, id(group.known), self._fleet, *robots, *spots
        if view.tick not in self._worked_out:
            self._worked_out.clear()
        parts = self._worked_out.setdefault(view.tick, {})
        if question not in parts:
            parts[question] = self._work_out(view, group.known, robots, np.array(spots))
        self._fleet = parts[question]

    def _work_out(
        self, view: View, known: KnownStations, robots: tuple[int, ...], poses: NDArray[np.float64]
    ) -> FleetParts:
        """Return the parts after these ones, in which each robot that has seen its station goes to another."""
        if robots not in known.drawings:
            roster = self._setup.fleet.roster
            known.drawings[robots] = Drawing(self._setup, known, [roster[number - 1] for number in robots])
        drawing: Drawing = known.drawings[robots]
        before = self._fleet
        period = int(view.tick * self._step / drawing.period_s)
        leads, assumed = drawing.leads_s(poses), self._ages
        assert assumed is not None
        spell = int(view.tick * self._step / self._spell_s)

        def draw(number: int, choice: int) -> float:
            return self._setup.fleet.chance(spell, number, choice)

        def oldest() -> Ages:
            return assumed.of_stations(view.tick, view.fog.patrolled, view.fog.last_seen)

        if drawing is not before.drawing or period != before.period:
            return FleetParts(drawing, drawing.begin(view.tick, oldest(), leads, draw), period)
        fleet = FleetParts(drawing, before.parts.copy(), period)
        parts, ways = fleet.parts.each, dict(zip(robots, leads, strict=True))
        arrived = [number for number in robots if self._is_done(view, fleet, parts[number])]
        turned = [
            number
            for number in robots
            if number not in arrived and self._has_turned(number, parts[number], ways[number])
        ]
        if arrived or turned:
            idle = [number for number in robots if not parts[number].route]
            drawing.draw(fleet.parts, sorted([*arrived, *turned, *idle]), arrived, view.tick, oldest(), leads, draw)
        return fleet

    def _is_done(self, view: View, fleet: FleetParts, part: Part) -> bool:
        """Return True if a robot's station has been seen, or is taken as given up."""
        if not part.route:
            return False
        assert fleet.drawing is not None
        return view.tick >= part.until or fleet.drawing.is_done(
            fleet.parts, part, lambda some: self._ages_of(view, some)
        )

    def _has_turned(self, number: int, part: Part, ways_s: Leads) -> bool:
        """Return True if a robot goes away from its station, as where its fog differs and it has drawn another one."""
        if not part.route:
            return False
        way_s = float(ways_s[part.route[0]])
        part.least_way_s = min(part.least_way_s, way_s)
        return way_s > part.least_way_s + self._turned_s[number]
