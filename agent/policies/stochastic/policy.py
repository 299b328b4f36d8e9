"""The default policy: visit the stations of the ground in an order that is drawn.

A patrol that follows a tour is the freshest, and an intruder that watches it knows where it will be. This one draws
each next station from good plans for the whole fleet (`agent.policies.stochastic.joint_plan`), and keeps to it until it
has been seen (`agent.policies.commitment.commitment`). With a fleet key the draws come from the key, so nobody else can
compute them (`agent.chance`).

Where there is no tour, because the ground is too large for one or the sensor does not look all around, each choice is
free; so are those of a robot for which no station is left.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from agent.policies.commitment.commitment import TRIES, Commitment
from agent.policies.stochastic.joint_plan import JointPlan
from patrol.scenario import StochasticOptions

if TYPE_CHECKING:
    from agent.ports import PolicySetup
    from agent.routes.routes import Element, Way
    from agent.view import View


class Stochastic(Commitment):
    """Draws its next station.

    Attributes:
        plan: The stations, and the plan for all; None where each choice is free.
    """

    Options = StochasticOptions

    def __init__(self, setup: PolicySetup) -> None:
        """Start without a target."""
        super().__init__(setup)
        laid_out = setup.round()
        stations = None if laid_out is None else laid_out.stations
        self.plan = None if laid_out is None or stations is None else JointPlan(setup, laid_out, stations)
        self._station: int | None = None

    def _take_note(self, view: View, goes_on: bool) -> bool:
        del goes_on
        if self.plan is None:
            return True
        self.plan.update(view)
        if self.plan.station != self._station:
            self._station, self.target = self.plan.station, None
        return False

    def _chosen(self, view: View, start: Element) -> Way | None:
        if self.plan is None or self.plan.station is None:
            return self._free_choice(view, start)
        self.target = None
        for _ in range(TRIES):
            visit = self.plan.visit(view, self.given_up)
            self._expected = 0
            way = None if visit is None else self._way_to(view, start, visit.stand)
            if visit is not None and way is not None:
                self._commit(view, visit)
                return way
            # Another robot may stand in the door: it goes elsewhere, and may come back soon.
            self.plan.give_up(view, self.given_up)
            self._station = self.plan.station
        return None
