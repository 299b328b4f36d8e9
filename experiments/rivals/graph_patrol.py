"""A robot on a graph: it drives to the vertices that its rule names, one after the other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

from pydantic import Field

from agent.ports import Bearing, Intent, Place, Stay
from experiments.rivals.known import Known
from patrol.graph import on_reach
from patrol.values import Section

if TYPE_CHECKING:
    from agent.ports import PolicySetup
    from agent.view import View

NO_NEARER_S = 15.0
"""A robot that has come no nearer to a vertex for so long takes it for visited, s."""

NO_NEARER_AT_HAND_S = 1.0
"""The same within the tolerance, s."""

NEARER = 0.1
"""Least share of a stride by which it must come nearer to count as progress.

A car stops beside a place and not on it: within this it is there.
"""


class GraphOptions(Section):
    """Settings of all patrols on graphs."""

    tolerance: float | None = Field(
        None,
        gt=0.0,
        description="m, within which a vertex is visited; null: the graph's `visit`, or half a stride if more",
    )


class GraphPatrol:
    """The part that the patrols on graphs have in common; each says in `route` where to go next."""

    Options: ClassVar[type[GraphOptions]] = GraphOptions

    def __init__(self, setup: PolicySetup) -> None:
        """Place the graph where the robot's body can go."""
        options = setup.options if isinstance(setup.options, GraphOptions) else self.Options()
        self.options = options
        self.step = setup.fleet.step
        self.speed = setup.robot.spec.speed
        self._beside = NEARER * self.speed * self.step if setup.robot.spec.model == "car" else 0.0
        graph = on_reach(setup.ground.graph(), setup.ground.terrain, setup.ground.fields.reach)
        tolerance = options.tolerance or graph.visit_reach(setup.robot.spec.speed, setup.fleet.step)
        self.known = Known(graph, tolerance, setup.fleet.step, setup.robot.spec.number, setup.fleet.team)
        self._route: list[int] = []
        self._least = math.inf
        self._since = 0

    def route(self, known: Known) -> Sequence[int]:
        """Choose the vertices to visit next, one after the other; without any the robot waits for a tick."""
        raise NotImplementedError

    def decide(self, view: View) -> Intent:
        """Go on to the next vertex of the route, or choose another route at its end."""
        state = self.known
        visited = state.look(view)
        if self._route and self._is_there(view, self._route[0] in visited):
            state.arrive(self._route.pop(0))
            self._least, self._since = math.inf, view.tick
        if not self._route:
            self._route = list(self.route(state))
            self._least, self._since = math.inf, view.tick
        if not self._route:
            return Stay()
        x, y = state.graph.places[self._route[0]].tolist()
        way = view.way((x, y))
        if way is None:
            return Bearing(())  # the body finds back to the reachable ground first
        if way.length < self._least - NEARER * view.stride or way.length == 0.0:
            self._least, self._since = way.length, view.tick
        return Place(x, y, bend=way.bend, figures={"vertex": float(self._route[0]), "way_m": way.length})

    def _is_there(self, view: View, visits: bool) -> bool:
        """Return True at the vertex, or where the robot comes no nearer: within the tolerance soon, else later."""
        stood_s = (view.tick - self._since) * self.step
        return self._least <= self._beside or stood_s > (NO_NEARER_AT_HAND_S if visits else NO_NEARER_S)
