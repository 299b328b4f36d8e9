"""Sightings of a run, as intruders can see it: written down while it is made or replayed."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from experiments.intruders.game import Game
from experiments.intruders.ground import IntruderGround, ground_of
from experiments.intruders.infiltrator import Infiltrator
from experiments.intruders.watch import PointNumbers, Watch, WatchLog
from patrol.errors import BadInput, did_you_mean
from patrol.ground.footprint import Footprint
from patrol.ground.shapes import cover
from patrol.pose import Pose
from patrol.radio.message import as_received
from patrol.scenario.sections import VERTICES
from patrol.zones.spec import points_of

if TYPE_CHECKING:
    from patrol.graph import Graph
    from patrol.ground.terrain import BoolGrid
    from patrol.prepare import Prepared

MOST_POINTS = 2000
"""Points of the ground on which intruders wait; of more, every so many are taken, row by row."""

MOST_ROBOTS = 200
"""Robots of the largest fleet that a moving intruder watches, spare ones included."""


class Sightings:
    """The places seen in each tick of a run: points of its ground, and the vertices of its graph."""

    def __init__(
        self,
        prepared: Prepared,
        footprint: Footprint,
        graph: Graph | None,
        ticks: int,
        infiltrator: Infiltrator | None = None,
    ) -> None:
        """Begin with nothing seen; raise BadInput where the scenario has no zone of the infiltrator's name.

        The footprint is on the ground as it is in each tick. Vertices are played on only with a graph, and more is
        written down only with an infiltrator.
        """
        patrolled, scenario = prepared.patrolled, prepared.scenario
        every = np.flatnonzero(patrolled)
        self.rows, self.cols = np.divmod(every[:: -(-len(every) // MOST_POINTS)], patrolled.shape[1])
        self.seen = np.zeros((ticks, len(self.rows)), dtype=np.bool_)
        self.visited = np.zeros((ticks, 0 if graph is None else graph.size), dtype=np.bool_)
        self._infiltrator = infiltrator
        self._objection = _objection(prepared, footprint)
        self._footprint = footprint
        self._numbers = PointNumbers(prepared.terrain.height, self.rows, self.cols)
        self._graph = graph
        self._reach: dict[int, float] = {}
        if graph is not None:
            self._reach = {spec.number: graph.visit_reach(spec.speed, scenario.step) for spec in scenario.roster}
        self._before: dict[int, tuple[float, float]] = {}
        self._log = None
        if infiltrator is not None and not self._objection:
            ground = _intruder_ground(prepared, infiltrator)
            self._log = WatchLog(ground, prepared.terrain.height, scenario.step, ticks, len(scenario.roster))

    def look(self, k: int, robots: Iterable[tuple[int, Pose]]) -> None:
        """Write down the next tick: number and true pose of each robot that takes part."""
        looks = [(number, (pose.x, pose.y), self._footprint.visible(as_received(pose))) for number, pose in robots]
        for _, _, view in looks:
            self.seen[k, self._numbers.in_view(view)] = True
        if self._log is not None:
            self._log.look(k, [(number - 1, spot, view) for number, spot, view in looks])
        if self._graph is not None:
            here = {number: spot for number, spot, _ in looks}
            for number, spot in here.items():
                near = self._graph.within(self._before.get(number, spot), spot, self._reach[number])
                self.visited[k, near] = True
            self._before = here

    def watched(self) -> Watch:
        """Return what a moving intruder can have seen so far, or raise BadInput where it cannot be played."""
        if self._log is None:
            raise BadInput(f"a moving intruder cannot be played: {self._objection or 'it was not asked for'}")
        return self._log.watch()

    def game(self) -> Game:
        """Return the moving intruder's game on the sightings, or raise BadInput where it cannot be played."""
        return Game(self.watched(), self._infiltrator or Infiltrator())


def _objection(prepared: Prepared, footprint: Footprint) -> str:
    """Return why a moving intruder cannot be played on any run of a scenario; empty where it can."""
    if footprint.leaves_age:
        return (
            "a look of this sensor leaves some of a point's age, so it is open whether an intruder in view is seen; "
            "use a sensor of quality 1"
        )
    if len(prepared.scenario.roster) > MOST_ROBOTS:
        return f"the fleet has {len(prepared.scenario.roster)} robots, and at most {MOST_ROBOTS} can be watched"
    if prepared.scenario.terrain.patrolled == VERTICES:
        return "only the vertices of a graph are patrolled, and no ground to cross; patrol the ground"
    return ""


def _intruder_ground(prepared: Prepared, infiltrator: Infiltrator) -> IntruderGround:
    """Return the ground of a moving intruder. Raises BadInput where the scenario has no such zone."""
    terrain, zones = prepared.terrain, {zone.name: zone for zone in prepared.scenario.zones}
    wants = None
    if infiltrator.zone is not None:
        if infiltrator.zone not in zones:
            remedy = did_you_mean(infiltrator.zone, list(zones)) if zones else "this scenario has none"
            raise BadInput(f"zone {infiltrator.zone}: there is no such zone; {remedy}")
        wants = points_of(zones[infiltrator.zone], terrain)
    return ground_of(prepared.patrolled, terrain.point, _entry_ground(prepared, infiltrator), wants)


def _entry_ground(prepared: Prepared, infiltrator: Infiltrator) -> BoolGrid | None:
    """Return where an intruder may enter, bool (h, w); None for the edge."""
    terrain, entries = prepared.terrain, infiltrator.entries
    if entries == "edge":
        return None
    if entries != "doors":
        return cover(entries, terrain.shape, terrain.point, terrain.origin)
    from patrol.ground.doors import Rooms  # here: it loads kernels that few runs need

    narrowest = min(prepared.scenario.roster, key=lambda spec: (spec.radius, spec.number))
    enters = np.zeros(terrain.shape, dtype=np.bool_)
    for door in Rooms(terrain, narrowest.radius, prepared.fields[narrowest.number].reach).doors():
        enters[terrain.point_at(door.x, door.y)] = True
    return enters
