"""The division of robots between the rounds of ground with zones.

Every robot divides the robots that it has heard lately, itself among them, between the rounds of the best division
(`patrol.zones.division`): by number, the lowest numbers to the ground with the greatest weight. All that hear
each other find the same. After a death, a newcomer or a long silence the division is made anew, and few robots change
rounds. So it is over other rounds when a zone begins or ends.

For example, robots 1 to 6, three for each of two rounds: 1, 2 and 3 share that of the zone. When 2 dies, and three
of the other five are best in the zone, then 4 joins 1 and 3 there, and 5 and 6 stay outside.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from agent.view import View
    from patrol.zones.division import Classes, Divisions


MEMORY = 0.5
"""Time for which a robot that is not heard is counted on, as a share of the time between two robots on a round of all
ground."""

LEAST_MEMORY_S = 30.0
"""Lower bound of the same, s."""


class Crew(NamedTuple):
    """The robots on one round, by number, and the classes of its ground."""

    classes: Classes
    robots: frozenset[int]


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
