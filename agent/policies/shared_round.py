"""The round that a robot shares with others, on ground with and without zones.

On ground with zones there are several rounds, and robots are divided between them
(`agent.policies.shared_round`); free choices count the age times the weight. Rounds, division and weights follow
the zones that are in force.

The division of robots between rounds, on ground whose points count differently, as one of them believes.

Every robot divides the robots that it has heard lately, itself among them, between the rounds of the best division
(`patrol.zones.division`): by number, the lowest numbers to the ground with the greatest weight. All that hear
each other find the same. After a death, a newcomer or a long silence the division is made anew, and few robots change
rounds. So it is over other rounds when a zone begins or ends.

For example, robots 1 to 6, three for each of two rounds: 1, 2 and 3 follow that of the zone. When 2 dies, and three
of the other five are best in the zone, then 4 joins 1 and 3 there, and 5 and 6 stay outside.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from agent.policies.commitment import Commitment
from patrol.measures.best_tour import followers_of, round_of
from patrol.measures.zoned import zoned_ground
from patrol.zones.division import Group
from patrol.zones.spec import weighing_at

if TYPE_CHECKING:
    from agent.ports import PolicySetup
    from agent.view import View
    from patrol.tours.round import Round
    from patrol.zones.division import Classes, ZonedGround


MEMORY = 0.5
"""Time for which a robot that is not heard is counted on, as a share of the time between two robots on a round of all
ground."""

LEAST_MEMORY_S = 30.0
"""Lower bound of the same, s."""


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

    def __init__(self, zoned: ZonedGround, number: int, robots: frozenset[int], team: int, step: float) -> None:
        """Begin before any robot is heard; ``robots`` are all robots, and ``team`` counts them without spare ones."""
        self._number = number
        self._robots = robots
        self._team = team
        self._step = step
        self._heard: dict[int, int] = {}
        self.divide(zoned)

    def divide(self, zoned: ZonedGround) -> None:
        """Divide robots between the rounds of ``zoned``, one or more, from now on."""
        self.zoned = zoned
        whole = zoned.rounds[0, len(zoned.classes) - 1]
        self._memory = max(MEMORY * whole.length_m / (self._team * zoned.speed), LEAST_MEMORY_S) / self._step
        self._crews: dict[frozenset[int], Crew] = {}

    def crew(self, view: View) -> Crew:
        """Return the robots that follow the same round as this robot, and which round that is."""
        self._heard = {number: at for number, at in self._heard.items() if view.tick - at <= self._memory}
        for number in self._robots & view.peers.keys():
            self._heard[number] = view.peers[number].tick
        self._heard[self._number] = view.tick
        team = frozenset(self._heard)
        if team not in self._crews:
            self._crews[team] = self._divided(sorted(team))
        return self._crews[team]

    def _divided(self, numbers: list[int]) -> Crew:
        begin = 0
        for group in reversed(self.zoned.divide(len(numbers))):
            robots = frozenset(numbers[begin : begin + group.robots])
            if self._number in robots:
                return Crew(group.classes, robots)
            begin += group.robots
        raise AssertionError("a division has a group for each robot")


class SharedRound(Commitment):
    """Shares a round with other robots; the base of policies that say what is next on it."""

    def __init__(self, setup: PolicySetup) -> None:
        super().__init__(setup)
        self.division: Division | None = None  # None where there is at most one round
        prepared, number = setup.ground.prepared, setup.robot.spec.number
        self._weighing = weighing_at(prepared.scenario.zones, 0.0)
        self._round: Round | None = None
        zoned = zoned_ground(prepared, self._weighing)
        if zoned is not None:
            self._take_zones(zoned)
        elif (laid_out := round_of(prepared, number)) is not None:
            self._share(laid_out, followers_of(prepared, number), None)

    def _share(self, laid_out: Round, robots: frozenset[int], view: View | None) -> None:
        """Share a round with some robots, this one among them, from now on.

        Meanwhile `_round` is still the one before, None for none. ``view`` is None before the first tick.
        """
        raise NotImplementedError

    def _round_of(self, zoned: ZonedGround, group: Group) -> Round:
        """Return the round of a group of robots, on ground with zones."""
        return zoned.round_of(group)

    def _leave_round(self) -> None:
        """Share no round from now on."""
        raise NotImplementedError

    def _take_zones(self, zoned: ZonedGround) -> None:
        """Go by the zones that are in force now: divide the robots between their rounds."""
        self._round, setup = None, self._setup
        if not zoned.rounds:
            self.division = None
            self._leave_round()
        elif self.division is None:
            self.division = Division(
                zoned, setup.robot.spec.number, frozenset(setup.fleet.radii), setup.fleet.team, setup.fleet.step
            )
        else:
            self.division.divide(zoned)

    def _take_note(self, view: View, goes_on: bool) -> bool:
        if view.weighing != self._weighing:
            self._weighing = view.weighing
            zoned = zoned_ground(self._setup.ground.prepared, view.weighing)
            assert zoned is not None
            self._take_zones(zoned)
        if self.division is not None:
            crew = self.division.crew(view)
            laid_out = self._round_of(self.division.zoned, crew.group)
            self._share(laid_out, crew.robots, view)
            self._round = laid_out
        return super()._take_note(view, goes_on)
