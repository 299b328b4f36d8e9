"""Keeping robots apart beyond sharing positions, and random steps (paper, "Artificial Obstacles", "Semaphores").

Obstacles and semaphores change where paths may lead. A claim says which robot a point is left to; what it weighs is up
to the policy.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.routes.ground import Area, Disc
from patrol.ground.cspace import narrow_passages
from patrol.ground.shapes import cover
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.pose import TAU, Pose
from patrol.radio.peers import Peer, places_of
from patrol.random import Purpose
from patrol.values import Polygons

if TYPE_CHECKING:
    from agent.ports import PolicySetup
    from agent.view import View


class RandomSteps:
    """Draws the random steps of one robot, with the same probability in each tick."""

    def __init__(self, probability: float) -> None:
        self._probability = probability

    def draw(self, view: View) -> float | None:
        """Return the direction of a random step, rad, or None in most ticks."""
        if self._probability > 0.0 and view.draw(0, Purpose.RANDOM_MOVE) < self._probability:
            return TAU * view.draw(1, Purpose.RANDOM_MOVE)
        return None


class Separation:
    """The separation of one robot from the others, as the policy's `separations` and `critical_areas` say."""

    def __init__(self, setup: PolicySetup) -> None:
        options, terrain, lengths = setup.options, setup.ground.terrain, setup.robot.lengths
        self._obstacle_radius = lengths.obstacle_radius if "artificial-obstacles" in options.separations else None
        self._point = terrain.point
        self._areas: list[Area] = []
        self._numbered: NDArray[np.int32] | None = None
        if "semaphores" in options.separations:
            areas = critical_areas(options.critical_areas, terrain, setup.ground.fields.reach, lengths.critical_width)
            self._areas = [Area(area) for area in areas]
            self._numbered = numbered(areas, terrain.shape) if areas else None

    def keep_apart(self, view: View) -> None:
        """Close artificial obstacles and occupied critical areas for this tick.

        Robots that surround an intruder have to stand near each other, so nothing is closed while one is known.
        """
        if view.contacts:
            return
        discs: list[Disc] = []
        if self._obstacle_radius is not None:
            discs = artificial_obstacles(view.pose, view.peers, self._obstacle_radius, self._point)
        areas = []
        if self._numbered is not None:
            occupied = occupied_areas(self._numbered, view.ground.terrain, view.pose, view.peers)
            areas = [self._areas[number - 1] for number in occupied]
        if discs or areas:
            view.ground.close(discs, areas)


def artificial_obstacles(pose: Pose, peers: Mapping[int, Peer], radius: float, point: float) -> list[Disc]:
    """Return a virtual obstacle at each peer (paper, "Artificial Obstacles").

    An obstacle is small enough not to cover the robot's own point.
    """
    discs = []
    for x, y in places_of(peers).tolist():
        apart = math.hypot(x - pose.x, y - pose.y) - point
        if apart > 0.0:
            discs.append((x, y, min(radius, apart)))
    return discs


def critical_areas(polygons: Polygons | None, terrain: Terrain, reach: BoolGrid, width: float) -> list[BoolGrid]:
    """Return the semaphores' areas: the scenario's polygons, or the narrow passages (paper, "Semaphores").

    Without polygons, passages narrower than `width` m count.
    """
    if polygons is None:
        return narrow_passages(terrain, reach, width)
    return [cover(polygon, terrain.shape, terrain.point, terrain.origin) for polygon in polygons]


def occupied_areas(areas: NDArray[np.int32], terrain: Terrain, pose: Pose, peers: Mapping[int, Peer]) -> list[int]:
    """Return which `numbered` areas a peer is in and this robot is not, ascending."""
    own_area = _area_at(areas, terrain, pose.x, pose.y)
    occupied = {_area_at(areas, terrain, x, y) for x, y in places_of(peers).tolist()}
    return sorted(occupied - {0, own_area})


def _area_at(areas: NDArray[np.int32], terrain: Terrain, x: float, y: float) -> int:
    row, col = terrain.point_at(x, y)
    return int(areas[row, col]) if terrain.inside(row, col) else 0


def numbered(areas: list[BoolGrid], shape: tuple[int, int]) -> NDArray[np.int32]:
    """Return critical areas as one grid of numbers from 1, with 0 for no area.

    Where two areas overlap the later one counts.
    """
    grid = np.zeros(shape, dtype=np.int32)
    for number, area in enumerate(areas, start=1):
        grid[area] = number
    return grid
