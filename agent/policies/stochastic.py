"""The default policy and the tour: visit the stations of the ground, by routes for the whole fleet.

Robots that follow the best routes keep the ground freshest, and an intruder that watches them knows where they will be.
That is the tour (`Committed`). The default (`Stochastic`) draws each next station from good routes
(`agent.policies.common_plan.drawing`). With a fleet key the draws come from the key, so only the fleet can compute them
(`agent.chance`).

No robot says where it is going. Each works out what all do, and takes its own part:

- *Where robots hear each other well*, from what they hear and believe (`agent.policies.common_plan.believed`).
- *Where much is lost or late*, from a simulated fleet, which all simulate alike
  (`agent.policies.common_plan.following`).

Choices are free where there is no round (`patrol.measures.best_tour`), where robots are crowded (`LEAST_STATIONS`),
with zones where much is lost or late, and for a robot for which no station is left, or to whose place no way leads.
They are free, too, where doors may close: each robot knows of other closed doors, so none can tell what the others do.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from agent.policies.commitment import Commitment
from agent.policies.common_plan.believed import Believed
from agent.policies.common_plan.following import OnPlan
from agent.policies.common_plan.stations import Groups, KnownStations
from agent.policies.division import Division
from agent.policies.living import Living
from patrol.errors import BadInput
from patrol.scenario import CommitmentOptions, CommittedOptions, StochasticOptions
from patrol.zones.division import KEPT
from patrol.zones.spec import weighing_at

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from agent.policies.commitment import Choice
    from agent.policies.pursuit import Pursuit
    from agent.ports import PolicySetup
    from agent.routes.routes import Element, Way
    from agent.view import View
    from patrol.tours.round import Round
    from patrol.zones.division import Divisions, ZonedGround


LEAST_STATIONS, LEAST_BEST = 5.0, 2.5
"""Least number of stations for each robot that is not spare, where they are drawn, and where they are not. With fewer,
another robot sees most of what one would plan to see before it."""


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
        has_zones: bool,
    ) -> None:
        """Begin without a station."""
        self._number, self._groups, self._free, self._living = setup.robot.spec.number, groups, free, living
        self._robots = robots
        self._regular = frozenset(spec.number for spec in setup.fleet.roster if not spec.spare)
        self._least = LEAST_STATIONS if setup.options.unpredictability > 0.0 else LEAST_BEST
        self._believed = Believed(setup, laid_out, free)
        # With zones, what is heard says which robots share the stations, so there is no plan that needs nothing heard.
        self._on_plan = None if has_zones else OnPlan(setup, free)
        self._choice: Believed | OnPlan | None = None  # None for free choices

    def follow_with(self, robots: frozenset[int]) -> None:
        """Share the stations with other robots."""
        self._robots = robots

    def forget(self) -> None:
        """Begin anew."""
        self._choice = None

    def waits(self, view: View) -> bool:
        """Return True for a robot that is where the plan has it only in a while."""
        del view
        return isinstance(self._choice, OnPlan) and self._choice.waits

    def note(self, view: View, pursuit: Pursuit) -> bool:
        """Take note of a tick; return True if the robot chooses freely."""
        living = self._living.note(view) & self._robots
        team = self._regular & self._robots
        # With zones, what weighs is to be visited however crowded robots are.
        is_small = self._on_plan is not None and len(self._groups.known) < self._least * len(team)
        if is_small and len(team) > 1:
            self._choice = None
            return True
        group = self._groups.find(self._number, team, living)
        # With zones there is no common plan, and one that hears nobody draws for itself alone.
        draws = self._living.hears_well or (self._on_plan is None and not view.peers)
        choice = self._believed if draws else self._on_plan
        if choice is None or not len(group.known):
            self._choice = None
            return True
        if choice is not self._choice:
            choice.forget()
            pursuit.target = None
        self._choice = choice
        return choice.note(view, pursuit, group)

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
        self.division: Division | None = None  # None where there is at most one round
        prepared, number = setup.ground.prepared, setup.robot.spec.number
        self._weighing = weighing_at(prepared.scenario.zones, 0.0)
        self._round: Round | None = None  # with zones, that of this robot
        # Where doors may close, each robot knows of other closed ones, so none can tell what the others do.
        self._shares = not setup.ground.sight.changes
        if not self._shares:
            return
        if (divisions := self._free.zones.under(self._weighing)) is not None:
            self._take_zones(divisions)
        elif not prepared.rounds:
            raise BadInput(
                "no rounds were found for this policy; give its class the attribute follows_rounds = True, as a class "
                "that makes a policy which follows rounds needs"
            )
        elif (laid_out := prepared.rounds[number]) is not None:
            self.choice = self._share(*_find_sharing(setup, laid_out), None)

    def _share(self, laid_out: Round, robots: frozenset[int], weights: NDArray[np.float64] | None) -> Choice:
        """Return the choice on a round that is shared with some robots, this one among them, or a free one.

        ``weights`` are None where all points count alike.
        """
        ground = self._setup.ground
        if laid_out.stations is None:
            return self._free
        # The round is kept, so that no other one gets its identity.
        groups_by_round: dict[tuple[object, ...], tuple[Round, Groups]] = ground.scratch.setdefault("groups", {})
        question = id(laid_out), self._weighing
        if question not in groups_by_round:
            known, prepared = KnownStations(laid_out, weights), ground.prepared
            groups = Groups(known, self._setup.fleet.roster, prepared.starts, prepared.terrain)
            groups_by_round[question] = laid_out, groups
        groups, has_zones = groups_by_round[question][1], self.division is not None
        return Drawn(self._setup, laid_out, groups, self._free, self._living, robots, has_zones)

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

    def _update_round(self, view: View) -> None:
        if not self._shares:
            return
        if view.weighing != self._weighing:
            self._weighing = view.weighing
            divisions = self._free.zones.under(view.weighing)
            assert divisions is not None
            self._take_zones(divisions)
        if self.division is not None:
            crew, zoned = self.division.crew(view), self.division.divisions.zoned
            # What weighs more is visited more often without being on the round twice.
            laid_out = zoned.rounds[crew.classes]
            if laid_out is not self._round:
                self.pursuit.target = None
                # Free choices are not bound to the ground of a zone.
                self.choice = self._share(laid_out, crew.robots, _with_margin(zoned))
            else:
                self.choice.follow_with(crew.robots)
            self._round = laid_out


class Committed(Stochastic):
    """Follows the best routes that are found, and draws nothing."""

    Options = CommittedOptions


def _find_sharing(setup: PolicySetup, laid_out: Round) -> tuple[Round, frozenset[int]]:
    """Return the round that a robot shares, and with which robots: all whose rounds show the same points.

    Of several radii, that of the widest robot, which all the others can follow.
    """
    rounds = {number: laid for number, laid in sorted(setup.ground.prepared.rounds.items()) if laid is not None}
    distinct = {id(shared): shared for shared in rounds.values()}
    points = np.sort(laid_out.points)
    alike = {key for key, other in distinct.items() if np.array_equal(np.sort(other.points), points)}
    sharing = frozenset(number for number, own in rounds.items() if id(own) in alike)
    widest = max(sorted(sharing), key=lambda number: setup.fleet.radii[number])
    return rounds[widest], sharing


def _with_margin(zoned: ZonedGround) -> NDArray[np.float64]:
    """Return the weights of the ground; greater where an age is wanted, as distances are uneven."""
    weights = zoned.weights.copy()
    for weight, wish in zip(zoned.classes, zoned.wanted, strict=True):
        weights[zoned.weights == weight] *= 1.0 if wish is None else KEPT
    return weights
