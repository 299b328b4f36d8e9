"""The setup of every body, and what all bodies share: the goal along a bearing, and giving way."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from agent.bodies.giveway import GiveWay
from agent.bodies.goal import GoalFinder
from agent.routes.ground import Disc, Ground
from agent.routes.way_back import WayBack

if TYPE_CHECKING:
    from agent.ports import Place
    from agent.routes.ground import Spot
    from agent.view import Draw, View
    from patrol.pose import Pose
    from patrol.radio.peers import Peer
    from patrol.scenario import BodyLengths, PatrolSpec, RobotSpec

CLEAR_SHARE = 0.5
"""A direction is good enough when the robot can make at least this share of a step in it."""

BLOCKED_SHARE = 0.1
"""A robot that can make less than this share of a step in every direction is in a dead end."""

BARELY = 1e-3
"""A move shorter than this counts as none, m."""


@dataclass(frozen=True, slots=True)
class BodySetup:
    """The inputs from which a body is built.

    Attributes:
        spec: The robot's number, model, speed (m/s), radius (m) and turning radius (m).
        radii: Radius in m of each robot of the fleet, by number.
        identity: The scenario's seed, the robot's number and its incarnation, for repeatable draws.
        step: s per tick.
        patrol: The scenario's section `patrol`.
        lengths: The lengths of the robot's patrol, m.
        ground: Where the robot's centre may be.
        psi: float32 (h, w) of `agent.bodies.refine.psi_field`, or None for no refinement of goals.
        chance: Repeatable draws.
    """

    spec: RobotSpec
    radii: Mapping[int, float]
    identity: tuple[int, int, int]
    step: float
    patrol: PatrolSpec
    lengths: BodyLengths
    ground: Ground
    psi: NDArray[np.float32] | None
    chance: Draw


class BodyBase:
    """The part that all bodies share.

    Attributes:
        spec: The robot's model and limits.
        stride: Longest way in one step, m.
        goals: Finds the goal along a bearing.
        way_back: Finds ways back to the reachable points.
    """

    def __init__(self, setup: BodySetup) -> None:
        self.spec = setup.spec
        self.stride = setup.spec.speed * setup.step
        self.goals = GoalFinder(setup.lengths, setup.ground, setup.psi)
        self.way_back = WayBack(setup.ground, setup.spec.radius, wanted=setup.patrol.manoeuvres)
        self._point = setup.ground.terrain.point
        gives = setup.patrol.give_way
        self._give_way = GiveWay(*setup.identity, dict(setup.radii), setup.step) if gives else None

    def obstacles(self, tick: int, pose: Pose, bumped: bool, peers: Mapping[int, Peer]) -> Sequence[Disc]:
        """Return the robots that this one gives way to (`agent.ports.Body.obstacles`)."""
        if self._give_way is None:
            return ()
        self._give_way.update(tick, pose, bumped, peers, 2.0 * self.stride)
        return self._give_way.discs(tick, pose, peers, self._point)


def way_of(place: Place, view: View) -> tuple[Spot, Spot] | None:
    """Return the target of a `Place` intent, and where the way there first bends.

    Args:
        place: The intent. A place that no way leads to is replaced by the nearest reachable one.
        view: Of this tick.

    Returns:
        Target and first bend, each x and y in m; None for a robot that is off the ground.
    """
    if view.start is None:
        return None
    spot = place.x, place.y
    if place.bend is not None:
        return spot, place.bend
    way = view.way(spot)
    assert way is not None
    exact = view.ground.terrain.point_at(*way.place) == view.ground.terrain.point_at(*spot)
    target = spot if exact else way.place
    return target, target if way.bend == way.place else way.bend
