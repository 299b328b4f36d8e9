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

import math
from typing import TYPE_CHECKING

import numpy as np

from agent.policies.joint_plan import JointPlan, KnownStations
from agent.policies.shared_round import SharedRound
from patrol.measures.best_tour import most_planned
from patrol.measures.zoned import zoned_ground
from patrol.scenario import StochasticOptions
from patrol.zones.division import KEPT

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from agent.view import View
    from patrol.tours.round import Round
    from patrol.zones.division import Group, ZonedGround


class Stochastic(SharedRound):
    """Draws its next station."""

    Options = StochasticOptions

    def _begin_round(self, laid_out: Round, robots: frozenset[int], view: View | None) -> JointPlan | None:
        del view
        if laid_out.stations is None:
            return None
        setup, ground, fleet = self._setup, self._setup.ground, self._setup.fleet
        weights, team, most_robots = None, float(len(robots)), math.inf
        if (zoned := zoned_ground(ground.prepared, self._weighing)) is not None:
            weights = _with_margin(zoned)  # free choices are not bound to the ground of a zone
        else:
            team /= len(fleet.roster) / fleet.team
            most_robots = most_planned(len(laid_out.points) * ground.terrain.point_area, ground.sight.range_m)
        stations = KnownStations(setup, laid_out, laid_out.stations, weights)
        return JointPlan(setup, laid_out, stations, self._free, robots, team, most_robots)

    def _round_of(self, zoned: ZonedGround, group: Group) -> Round:
        return zoned.rounds[group.classes]  # what weighs more is visited more often without being there twice


def _with_margin(zoned: ZonedGround) -> NDArray[np.float64]:
    """Return the weights of the ground; greater where an age is wanted, as distances are uneven."""
    weights = zoned.weights.copy()
    for weight, wish in zip(zoned.classes, zoned.wanted, strict=True):
        weights[zoned.weights == weight] *= 1.0 if wish is None else KEPT
    return weights
