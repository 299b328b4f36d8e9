"""The round that a robot shares with others, on ground with and without zones.

On ground with zones there are several rounds, and robots are divided between them; free choices count the age times
the weight. Rounds, division and weights follow the zones that are in force.

Every robot divides the robots that it has heard lately, itself among them, between the rounds of the best division
(`patrol.zones.division`): by number, the lowest numbers to the ground with the greatest weight. All that hear
each other find the same. After a death, a newcomer or a long silence the division is made anew, and few robots change
rounds. So it is over other rounds when a zone begins or ends.

For example, robots 1 to 6, three for each of two rounds: 1, 2 and 3 follow that of the zone. When 2 dies, and three
of the other five are best in the zone, then 4 joins 1 and 3 there, and 5 and 6 stay outside.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from agent.policies.commitment import Choice, Commitment
from patrol.errors import BadInput
from patrol.measures.best_tour import followers_of
from patrol.zones.division import Group
from patrol.zones.spec import weighing_at

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from agent.policies.pursuit import GivenUp
    from agent.ports import PolicySetup
    from agent.view import View
    from patrol.tours.round import Flat, Round
    from patrol.zones.division import Classes, Divisions


MEMORY = 0.5
"""Time for which a robot that is not heard is counted on, as a share of the time between two robots on a round of all
ground."""

LEAST_MEMORY_S = 30.0
"""Lower bound of the same, s."""

LOSSY = 0.05
"""Share of positions that are lost, over about `LOSSES_S`, from which on robots cannot rely on believing the same. They
can again once half as many are."""

LOSSES_S = 300.0
"""Time over which losses are averaged, s."""


class Loss:
    """Notices whether many positions of others are lost. Those that were never sent count as lost."""

    def __init__(self, step: float) -> None:
        self.is_lossy = False
        self._share = 0.0
        self._weight = step / LOSSES_S

    def note(self, tick: int, heard: Collection[int]) -> None:
        """Take note of a tick, by the ticks in which other robots were heard last."""
        lost = sum(last < tick for last in heard) / max(len(heard), 1)
        self._share += (lost - self._share) * self._weight
        self.is_lossy = self._share > (0.5 * LOSSY if self.is_lossy else LOSSY)


class RoundStands:
    """The stands of one robot for the points of a round.

    A point is seen from its place on the round. Where that is given up, or no way leads there now, it may be seen from
    the point itself, or from its post where no body fits.
    """

    def __init__(self, setup: PolicySetup, laid_out: Round) -> None:
        """Find the point itself, or its post, for each point of the round."""
        points = laid_out.points
        fields = setup.ground.fields
        own_stands = np.where(fields.reach.reshape(-1)[points], points, fields.proxy.reshape(-1)[points])
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


class Crew(NamedTuple):
    """The robots on one round, by number, and the classes of its ground."""

    classes: Classes
    robots: frozenset[int]

    @property
    def group(self) -> Group:
        """The group of the division."""
        return Group(self.classes, len(self.robots))


class Division:
    """The division of the robots that one robot hears."""

    def __init__(self, divisions: Divisions, number: int, robots: frozenset[int], team: int, step: float) -> None:
        """Begin before any robot is heard; ``robots`` are all robots, and ``team`` counts them without spare ones."""
        self._number = number
        self._robots = robots
        self._team = team
        self._step = step
        self._heard: dict[int, int] = {}
        self.divide(divisions)

    def divide(self, divisions: Divisions) -> None:
        """Divide robots between the rounds of other ground, one or more, from now on."""
        self.divisions, zoned = divisions, divisions.zoned
        full_round = zoned.rounds[0, len(zoned.classes) - 1]
        self._memory = max(MEMORY * full_round.length_m / (self._team * zoned.speed), LEAST_MEMORY_S) / self._step
        self._crews: dict[frozenset[int], Crew] = {}

    def crew(self, view: View) -> Crew:
        """Return the robots that follow the same round as this robot, and which round that is."""
        self._heard = {number: tick for number, tick in self._heard.items() if view.tick - tick <= self._memory}
        for number in self._robots & view.peers.keys():
            self._heard[number] = view.peers[number].tick
        self._heard[self._number] = view.tick
        team = frozenset(self._heard)
        if team not in self._crews:
            self._crews[team] = self._divide_robots(sorted(team))
        return self._crews[team]

    def _divide_robots(self, numbers: list[int]) -> Crew:
        begin = 0
        # In reverse, so that the lowest numbers get the round with the greatest weight.
        for group in reversed(self.divisions.divide(len(numbers))):
            robots = frozenset(numbers[begin : begin + group.robots])
            if self._number in robots:
                return Crew(group.classes, robots)
            begin += group.robots
        raise AssertionError("a division has a group for each robot")


class SharedRound(Commitment):
    """Chooses on a round that it shares with other robots, and freely where there is none."""

    follows_rounds: ClassVar[bool] = True  # so rounds are found before a run

    def __init__(self, setup: PolicySetup) -> None:
        super().__init__(setup)
        self.division: Division | None = None  # None where there is at most one round
        prepared, number = setup.ground.prepared, setup.robot.spec.number
        self._weighing = weighing_at(prepared.scenario.zones, 0.0)
        self._since = 0  # tick from which on the zones in force count
        self._round: Round | None = None
        if (divisions := self._free.zones.under(self._weighing)) is not None:
            self._take_zones(divisions)
        elif not prepared.rounds:
            raise BadInput(
                "no rounds were found for this policy; give its class the attribute follows_rounds = True, as a class "
                "that makes a policy which follows rounds needs"
            )
        elif (laid_out := prepared.rounds[number]) is not None:
            self.choice = self._begin_round(laid_out, followers_of(prepared.rounds, number), None)

    def _begin_round(self, laid_out: Round, robots: frozenset[int], view: View | None) -> Choice:
        """Return the choice on a round that is shared with some robots, this one among them, or a free one.

        Meanwhile `_round` is still the one before, None for none. ``view`` is None before the first tick.
        """
        raise NotImplementedError

    def _round_of(self, divisions: Divisions, group: Group) -> Round:
        """Return the round of a group of robots, on ground with zones."""
        return divisions.round_of(group)

    def _take_zones(self, divisions: Divisions) -> None:
        """Go by the zones that are in force now: divide the robots between their rounds."""
        self._round, setup = None, self._setup
        if not divisions.zoned.rounds:
            self.division, self.choice = None, self._free
        elif self.division is None:
            self.division = Division(
                divisions, setup.robot.spec.number, frozenset(setup.fleet.radii), setup.fleet.team, setup.fleet.step
            )
        else:
            self.division.divide(divisions)

    def _update_round(self, view: View, goes_on: bool) -> None:
        if view.weighing != self._weighing:
            self._weighing, self._since = view.weighing, view.tick if goes_on else 0
            divisions = self._free.zones.under(view.weighing)
            assert divisions is not None
            self._take_zones(divisions)
        if self.division is not None:
            crew = self.division.crew(view)
            laid_out = self._round_of(self.division.divisions, crew.group)
            # Rounds are kept, so the same round is the same object.
            if laid_out is not self._round:
                self.pursuit.target = None
                self.choice = self._begin_round(laid_out, crew.robots, view)
            else:
                self.choice.follow_with(crew.robots)
            self._round = laid_out
