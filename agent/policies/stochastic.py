"""The default policy: visit the stations of the ground in an order that is drawn.

A patrol that follows a tour is the freshest, and an intruder that watches it knows where it will be. This one draws
each next station from good plans for the whole fleet (`agent.policies.joint_plan`), and keeps to it until it
has been seen (`agent.policies.commitment`). With a fleet key the draws come from the key, so only the fleet
can compute them (`agent.chance`).

Where there is no tour (`patrol.measures.best_tour`), as in a fleet of several speeds or with a sensor that does not
look all around, each choice is free. So it is where robots are crowded (`most_planned`), where many positions are lost,
and for a robot for which no station is left.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from agent.policies.joint_plan import JointPlan
from agent.policies.shared_round import SharedRound
from patrol.measures.zoned import zoned_ground
from patrol.scenario import StochasticOptions
from patrol.zones.division import KEPT

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from agent.ports import PolicySetup
    from agent.routes.routes import Element, Way
    from agent.view import View
    from patrol.tours.round import Round
    from patrol.zones.division import Group, ZonedGround


class Stochastic(SharedRound):
    """Draws its next station."""

    Options = StochasticOptions

    def __init__(self, setup: PolicySetup) -> None:
        self.plan: JointPlan | None = None  # None where each choice is free
        self._station: int | None = None
        super().__init__(setup)

    def _share(self, laid_out: Round, robots: frozenset[int], view: View | None) -> None:
        del view
        setup = self._setup
        if laid_out is not self._round:
            zoned = zoned_ground(setup.ground.prepared, self._weighing)
            weights = None if zoned is None else _with_margin(zoned)
            self._station = self.target = None
            self.plan = None if laid_out.stations is None else JointPlan(setup, laid_out, laid_out.stations, weights)
        if self.plan is not None:
            self.plan.robots = robots
            spare_too = len(setup.fleet.roster) / setup.fleet.team if self.division is None else 1.0
            self.plan.team = len(robots) / spare_too

    def _round_of(self, zoned: ZonedGround, group: Group) -> Round:
        return zoned.rounds[group.classes]  # what weighs more is visited more often without being there twice

    def _leave_round(self) -> None:
        self.plan = self._station = None

    def _forget(self) -> None:
        super()._forget()
        if self.plan is not None:
            self.plan.parts = {}

    def _take_note(self, view: View, goes_on: bool) -> bool:
        super()._take_note(view, goes_on)
        if self.plan is None:
            return True
        self.plan.update(view)
        if self.plan.station != self._station:
            self._station, self.target = self.plan.station, None
        return self._station is None

    def _chosen(self, view: View, start: Element) -> Way | None:
        self.target = None
        visit = None if self.plan is None else self.plan.visit(view, self.given_up)
        if visit is not None:
            self._expected = 0
            way = self._way_to(view, start, visit.stand)
            if way is not None:
                self._commit(view, visit)
                return way
        # No way leads there now. Another robot may stand in the door, and the two would wait for each other.
        return self._free_choice(view, start)


def _with_margin(zoned: ZonedGround) -> NDArray[np.float64]:
    """Return the weights of the ground; greater where an age is wanted, as distances are uneven."""
    weights = zoned.weights.copy()
    for weight, wish in zip(zoned.classes, zoned.wanted, strict=True):
        weights[zoned.weights == weight] *= 1.0 if wish is None else KEPT
    return weights
