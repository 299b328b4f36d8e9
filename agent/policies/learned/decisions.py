"""The decisions of a learned policy: when one is due, and what its answer means.

actions   an action is                                                                  it means
bearing   0 to 7, a sector of `observation`, or 8                                       Bearing, or Stay
place     two numbers in [-1, 1]: x and y from the robot, in half windows               Place
node      a vertex of the terrain's graph, moved to the nearest ground of this body     Place
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.policies.learned.observation import SECTORS, Observation, Observer, bearing_of
from agent.ports import Bearing, Intent, Place, Stay
from patrol.graph.from_ground import on_reach

if TYPE_CHECKING:
    from agent.ports import PolicySetup
    from agent.routes.ground import Spot
    from agent.routes.routes import Way
    from agent.view import View
    from patrol.scenario.policies import LearnedOptions

STAY = SECTORS
"""The action that stands still."""

MASK = "action_mask"
"""The part of an environment's observation that says which actions may be chosen; no network gets it."""

NO_NEARER_S = 15.0
"""A robot that has come no nearer to a place for so long has arrived, s."""

NEARER = 0.1
"""Least share of a stride that counts as nearer."""

Action = int | NDArray[np.float32]


class Decisions:
    """The decisions of one robot, one after the other."""

    def __init__(self, setup: PolicySetup, options: LearnedOptions) -> None:
        self.observer = Observer(setup.terrain, options, setup.step)
        self._kind, self._lasts = options.actions, options.decide == "arrival"
        self._patience = NO_NEARER_S / setup.step
        self._nodes: list[Spot] = []
        self.choices: int | None = None  # number of actions; None where an action is two numbers
        if options.actions == "node":
            places = on_reach(setup.graph(), setup.terrain, setup.fields.reach).places
            self._nodes = [(x, y) for x, y in places.tolist()]
            self.choices = len(self._nodes)
        elif options.actions == "bearing":
            self.choices = SECTORS + 1
        self._bearing: float | None = None
        self._place: Spot | None = None
        self._least = math.inf
        self._since = 0
        self._last_way: tuple[int, Way | None] | None = None

    def is_due(self, view: View) -> bool:
        """Return True if an action must be taken before `intent` is asked for; it changes nothing."""
        if not self._lasts or self._place is None:
            return True
        way = self._way(view, self._place)
        if way is None:
            return False  # the body finds back to the reachable ground first
        is_stuck = view.tick - self._since >= self._patience and not self._is_nearer(way, view)
        return is_stuck or way.length <= 0.5 * view.stride

    def observe(self, view: View) -> Observation:
        """Return the observation to decide by."""
        return self.observer.observe(view)

    def mask(self, view: View) -> NDArray[np.int8] | None:
        """Return 1 for each action that leads anywhere, 0 for others; None where an action is two numbers.

        A bearing leads somewhere if the next point is open, and staying always does. If no bearing does, all count.
        """
        if self.choices is None:
            return None
        mask = np.ones(self.choices, dtype=np.int8)
        if self._kind == "bearing":
            free = self.observer.free_ways(view) > 0
            if free.any():
                mask[:SECTORS] = free
        return mask

    def take(self, action: Action, view: View) -> None:
        """Decide on an action of the module's table: any kind of integer, or any sequence of two numbers."""
        self._least, self._since, self._last_way = math.inf, view.tick, None
        if self._kind == "node":
            self._place = self._nodes[int(action)]
        elif self._kind == "bearing":
            self._bearing = None if int(action) == STAY else bearing_of(int(action))
        else:
            across, up = (min(max(float(share), -1.0), 1.0) * self.observer.half_m for share in np.asarray(action))
            self._place = view.pose.x + across, view.pose.y + up

    def intent(self, view: View) -> Intent:
        """Return the intent that the last action means, once in a tick."""
        if self._place is None:
            return Stay() if self._bearing is None else Bearing((self._bearing,))
        if not self._lasts:
            return Place(*self._place)
        way = self._way(view, self._place)
        if way is None:
            return Bearing(())
        if self._is_nearer(way, view):
            self._least, self._since = way.length, view.tick
        return Place(*self._place, bend=way.bend)

    def _way(self, view: View, place: Spot) -> Way | None:
        if self._last_way is None or self._last_way[0] != view.tick:
            self._last_way = view.tick, view.way(place)
        return self._last_way[1]

    def _is_nearer(self, way: Way, view: View) -> bool:
        return way.length < self._least - NEARER * view.stride
