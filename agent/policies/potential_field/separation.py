"""Keeping robots apart beyond sharing positions (paper, "Artificial Obstacles", "Semaphores", and repulsive forces).

Obstacles and semaphores change where paths may lead; repulsion changes the forces. Claims are in
`agent.policies.potential_field.pull.claims`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from agent.routes.ground import Disc
from patrol.ground.doors.passages import narrow_passages
from patrol.ground.shapes import cover
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.pose import TAU, Pose
from patrol.radio.peers import Peer, places_of
from patrol.scenario import PatrolSpec


def artificial_obstacles(pose: Pose, peers: Mapping[int, Peer], radius: float, point: float) -> list[Disc]:
    """A virtual obstacle at each peer, small enough not to cover the robot's own point (paper, "Artificial Obstacles").

    Args:
        pose: The robot's own.
        peers: The robots heard so far, by number.
        radius: Of the obstacles, m.
        point: Side of the terrain's points, m.

    Returns:
        Discs (x, y, radius) in m.
    """
    discs = []
    for x, y in places_of(peers).tolist():
        apart = math.hypot(x - pose.x, y - pose.y) - point
        if apart > 0.0:
            discs.append((x, y, min(radius, apart)))
    return discs


def critical_areas(patrol: PatrolSpec, terrain: Terrain, reach: BoolGrid, width: float) -> list[BoolGrid]:
    """The semaphores' areas: the scenario's polygons, or the narrow passages where it gives none (paper, "Semaphores").

    Args:
        patrol: The scenario's section `patrol`.
        terrain: The map.
        reach: bool (h, w), the points on which the robot's centre may be.
        width: Passages narrower than this count as narrow, m.

    Returns:
        bool (h, w) for each area.
    """
    if patrol.critical_areas is None:
        return narrow_passages(terrain, reach, width)
    return [cover(polygon, terrain.shape, terrain.point, terrain.origin) for polygon in patrol.critical_areas]


def occupied_areas(areas: NDArray[np.int32], terrain: Terrain, pose: Pose, peers: Mapping[int, Peer]) -> list[int]:
    """The critical areas that a peer is in and this robot is not.

    Args:
        areas: int32 (h, w), the number of each point's critical area, 0 for none.
        terrain: The map.
        pose: The robot's own.
        peers: The robots heard so far, by number.

    Returns:
        The areas' numbers, ascending.
    """
    own = _area_at(areas, terrain, pose.x, pose.y)
    taken = {_area_at(areas, terrain, x, y) for x, y in places_of(peers).tolist()}
    return sorted(taken - {0, own})


def repel(sums: NDArray[np.float64], pose: Pose, peers: Mapping[int, Peer], patrol: PatrolSpec) -> None:
    """Add repulsive forces from the peers.

    Each peer pushes straight away with ``repulsion`` times the sum of all attraction, times exp(-(d /
    repulsion_reach)^2). The paper gives no formula; this one is relative to the attraction, whatever its scale.

    Args:
        sums: The sums of an `agent.policies.potential_field.pull.field.Pull`; changed in place.
        pose: The robot's own.
        peers: The robots heard so far, by number.
        patrol: The scenario's section `patrol`.
    """
    as_vector = patrol.direction == "vector"
    total = float(sums[2] if as_vector else sums.sum())
    for x, y in places_of(peers).tolist():
        across, up = pose.x - x, pose.y - y
        distance = math.hypot(across, up)
        if distance == 0.0:
            continue
        force = patrol.repulsion * total * math.exp(-((distance / patrol.repulsion_reach) ** 2))
        if as_vector:
            sums[0] += force * across / distance
            sums[1] += force * up / distance
        else:
            sums[round(math.atan2(up, across) / (TAU / sums.size)) % sums.size] += force


def _area_at(areas: NDArray[np.int32], terrain: Terrain, x: float, y: float) -> int:
    row, col = terrain.point_at(x, y)
    return int(areas[row, col]) if terrain.inside(row, col) else 0


def numbered(areas: list[BoolGrid], shape: tuple[int, int]) -> NDArray[np.int32]:
    """Critical areas as one grid of numbers.

    Args:
        areas: bool (h, w) for each area.
        shape: (h, w).

    Returns:
        int32 (h, w), numbers from 1, 0 for no area; where two areas overlap the later one counts.
    """
    grid = np.zeros(shape, dtype=np.int32)
    for number, area in enumerate(areas, start=1):
        grid[area] = number
    return grid
