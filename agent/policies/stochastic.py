"""The default policy and the tour: visit the stations of the ground, by routes for the whole fleet.

Robots that follow the best routes keep the ground freshest, and an intruder that watches them knows where they will be.
That is the tour (`Committed`). The default (`Stochastic`) draws each next station from good routes
(`agent.policies.common_plan.drawing`). With a fleet key the draws come from the key, so only the fleet can compute them
(`agent.chance`).

No robot says where it is going. Each works out what all do, and takes its own part:

- *Where robots hear each other well*, from what they hear and believe (`agent.policies.common_plan.believed`).
- *Where much is lost or late*, from a simulated fleet, which all simulate alike
  (`agent.policies.common_plan.following`).

Where zones weigh, the ages of their points count more (`patrol.measures.zoned`), so robots come by them more often.

Choices are free where there is no round (`patrol.measures.best_tour`), where robots are crowded (`LEAST_STATIONS`) or
too few for the ground (`MOST_PLANNED`), and for a robot for which no station is left, or to whose place no way leads.
They are free, too, where robots know different things of what is in the way, so none can tell what the others do: where
doors may close, where much is lost and one of them is dead, stuck or at a dock, and for a robot that a wreck keeps from
seeing some ground, or may keep from it.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from agent.policies.commitment import Commitment
from agent.policies.common_plan.believed import Believed
from agent.policies.common_plan.following import OnPlan
from agent.policies.common_plan.stations import Groups, KnownStations
from agent.policies.common_plan.turns import Turns
from agent.policies.living import Living
from patrol.errors import BadInput
from patrol.measures.zoned import MOST_KEPT
from patrol.scenario import CommitmentOptions, CommittedOptions, StochasticOptions
from patrol.scenario.sections import BUILT_IN_SENSORS
from patrol.tours.round import ways_between
from patrol.zones.spec import weighing_at

if TYPE_CHECKING:
    from agent.policies.commitment import Choice
    from agent.policies.common_plan.stations import Group
    from agent.policies.pursuit import Pursuit
    from agent.ports import PolicySetup
    from agent.routes.routes import Element, Way
    from agent.view import View
    from patrol.tours.round import Flat, Round


LEAST_STATIONS, LEAST_BEST = 4.0, 2.5
"""Least number of stations for each robot that is not spare, where they are drawn, and where they are not. With fewer,
another robot sees most of what one would plan to see before it."""

SHORT, LONG = 1.45, 10.0
"""Length of the tour for each, in ranges of the sensor, below which robots are crowded however many stations there are,
and from which on they are not: few vertices may lie far apart."""

DENSE, SHORT_DENSE = 3.5, 2.7
"""Stations in a range of the tour above which rooms count as small, and what takes the place of `SHORT` there."""

MOST_PLANNED = 4_000
"""Largest number of stations that a group plans; with more, as for few robots on large ground, its choices are free."""

OLDEST_ROUNDS = 4.0
"""Age of ground from which on a robot that does not live may bar the way to it, in rounds of those that do."""

MARGIN = 1.25
"""How many times as much as its wanted age says the ground of a zone counts, since distances between robots are uneven.
"""


class Drawn:
    """The choice of one robot's stations, of those that it shares with others."""

    def __init__(
        self,
        setup: PolicySetup,
        laid_out: Round,
        groups: Groups,
        free: Choice,
        living: Living,
        robots: frozenset[int],  # those that share the stations
    ) -> None:
        """Begin without a station."""
        self._number, self._groups, self._free, self._living = setup.robot.spec.number, groups, free, living
        self._robots, sight = robots, setup.ground.sight
        self._team = robots & frozenset(spec.number for spec in setup.fleet.roster if not spec.spare)
        known, team = groups.known, max(len(self._team), 1)
        fewest = LEAST_STATIONS if setup.options.unpredictability > 0.0 else LEAST_BEST
        ranges = known.length_m / (team * sight.range_m)
        shortest = SHORT_DENSE if len(known) > DENSE * team * ranges else SHORT
        self._is_crowded = team > 1 and (ranges < shortest or (len(known) < fewest * team and ranges < LONG))
        self._believed, self._on_plan = Believed(setup, laid_out, free), OnPlan(setup, free)
        self._choice: Believed | OnPlan | None = None  # None for free choices
        self._lived: frozenset[int] | None = None
        self._group: Group | None = None  # of those; None for crowded robots
        self._team_lives = True
        self._oldest = math.inf  # age of ground from which on a wreck may bar the way to it, ticks
        self._round_ticks = known.length_m / setup.fleet.step  # of a robot at 1 m/s
        self._speeds = {spec.number: spec.speed for spec in setup.fleet.roster}

    def forget(self) -> None:
        """Begin anew."""
        self._choice = None

    @property
    def waits(self) -> bool:
        """True for a robot that is where the plan has it only in a while."""
        return isinstance(self._choice, OnPlan) and self._choice.waits

    def note(self, view: View, pursuit: Pursuit) -> bool:
        """Take note of a tick; return True if the robot chooses freely."""
        living = self._living.note(view)
        if living is not self._lived and not self._is_crowded:
            self._lived, self._group = living, self._groups.find(self._number, self._team, living & self._robots)
            self._team_lives = self._team <= living
            speed = sum(self._speeds[number] for number in sorted(living & self._robots))
            self._oldest = math.inf if self._team_lives else OLDEST_ROUNDS * self._round_ticks / speed
        group, choice = self._group, self._choose_by(view)
        if choice is None or group is None or not 0 < len(group.known) <= MOST_PLANNED:
            self._choice = None
            return True
        if choice is not self._choice:
            choice.forget()
            pursuit.target = None
        self._choice = choice
        return choice.note(view, pursuit, group)

    def _choose_by(self, view: View) -> Believed | OnPlan | None:
        """Return what the robot chooses by now, None for free choices."""
        # The others go on as if it got there.
        if (left_out := view.fog.left_out) is not None and left_out.any():
            return None
        if self._living.hears_well:
            # Ground as old as that makes all stations near by alike to a draw. Where zones weigh, some may be that old.
            return None if view.mfow > self._oldest and not view.weighing else self._believed
        # Each has heard a dead one last at another place, so they cannot plan round its wreck alike.
        return self._on_plan if self._team_lives else None

    def next(self, view: View, start: Element, pursuit: Pursuit) -> Way | None:
        """Commit to the next target, and return the way there."""
        return (self._choice or self._free).next(view, start, pursuit)


class Stochastic(Commitment):
    """Draws its next station."""

    Options: type[CommitmentOptions] = StochasticOptions
    follows_rounds: ClassVar[bool] = True  # so rounds are found before a run

    def __init__(self, setup: PolicySetup) -> None:
        super().__init__(setup)
        self._living = Living(setup)
        prepared, number = setup.ground.prepared, setup.robot.spec.number
        self._weighing = weighing_at(prepared.scenario.zones, 0.0)
        # Where doors may close, each robot knows of other closed ones, so none can tell what the others do.
        self._sharing: tuple[int, frozenset[int]] | None = None
        if setup.ground.sight.changes:
            return
        if not prepared.rounds:
            raise BadInput(
                "no rounds were found for this policy; give its class the attribute follows_rounds = True, as a class "
                "that makes a policy which follows rounds needs"
            )
        if (laid_out := prepared.rounds[number]) is not None:
            self._sharing = _find_sharing(setup, laid_out.points)
            self._share(*self._sharing)

    def _share(self, widest_robot: int, robots: frozenset[int]) -> None:
        """Choose on the widest robot's round, shared with some robots, this one among them, by the zones in force."""
        ground, prepared = self._setup.ground, self._setup.ground.prepared
        laid_out = prepared.rounds[widest_robot]
        assert laid_out is not None
        # The round is kept, so that no other one gets its identity.
        groups_by_round: dict[tuple[object, ...], tuple[Round, Groups]] = ground.scratch.setdefault("groups", {})
        question = id(laid_out), self._weighing
        if question not in groups_by_round:
            reach = prepared.fields[widest_robot].reach
            find_ways = partial(ways_between, prepared.terrain, reach, range_m=ground.sight.range_m)
            widest, sensor = self._setup.fleet.roster[widest_robot - 1], prepared.scenario.sensor
            # The angle of a sensor of one's own is not known.
            angle = math.radians(sensor.angle) if sensor.kind in BUILT_IN_SENSORS else 0.0
            find_turns = partial(Turns, widest.radius, angle, prepared.terrain)
            weights = self._free.zones.under(self._weighing, MARGIN)
            known = KnownStations(laid_out, find_ways, weights, find_turns)
            groups = Groups(known, self._setup.fleet.roster, prepared.starts, prepared.terrain)
            groups_by_round[question] = laid_out, groups
            for oldest in [key for key in groups_by_round if key[1] != self._weighing][:-MOST_KEPT]:
                del groups_by_round[oldest]
        groups = groups_by_round[question][1]
        self.choice = Drawn(self._setup, laid_out, groups, self._free, self._living, robots)

    def _update_zones(self, view: View) -> None:
        if self._sharing is not None and view.weighing != self._weighing:
            self._weighing, self.pursuit.target = view.weighing, None
            self._share(*self._sharing)


class Committed(Stochastic):
    """Follows the best routes that are found, and draws nothing."""

    Options = CommittedOptions


def _find_sharing(setup: PolicySetup, shown: Flat) -> tuple[int, frozenset[int]]:
    """Return the widest of the robots that share a round, and all of them: those whose rounds show the same points.

    All the others can follow the widest one's round.
    """
    rounds = {number: laid for number, laid in sorted(setup.ground.prepared.rounds.items()) if laid is not None}
    distinct = {id(shared): shared for shared in rounds.values()}
    points = np.sort(shown)
    alike = {key for key, other in distinct.items() if np.array_equal(np.sort(other.points), points)}
    if not setup.ground.sight.all_round:
        # Each model has rounds of its own.
        alike = {id(rounds[setup.robot.spec.number])}
    sharing = frozenset(number for number, own in rounds.items() if id(own) in alike)
    return max(sorted(sharing), key=lambda number: setup.fleet.radii[number]), sharing
