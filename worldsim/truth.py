"""The truth that robots see: the fog of the whole fleet from its true poses, and the intruders in view.

The world reports both, and the verdict computes them again.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.ground.fog import Fog
from patrol.ground.footprint import Footprint
from patrol.pose import Pose
from patrol.radio.message import MAX_CONTACTS, as_received

if TYPE_CHECKING:
    from patrol.scenario import Scenario

__all__ = ["Truth"]


class Truth:
    """The true fog over the patrolled area; ages are in ticks."""

    def __init__(self, footprint: Footprint, patrolled: NDArray[np.bool_]) -> None:
        """Begin with nothing seen; `patrolled`, bool (h, w), marks the points that count."""
        self.footprint = footprint
        self.fog = Fog(patrolled)

    def observe(self, tick: int, poses: Iterable[tuple[int, Pose]]) -> None:
        """Let robots look around once from their true poses, in the order given."""
        for _, pose in poses:
            self.fog.observe(self.footprint.visible(as_received(pose)), tick)


Place = tuple[float, float]
"""x and y in m."""


class Intruders:
    """A scenario's intruders, seen by its robots' sensor."""

    def __init__(self, scenario: Scenario, footprint: Footprint) -> None:
        self._intruders = scenario.intruders
        self._step = scenario.step
        self._footprint = footprint

    def seen_by(self, tick: int, pose: Pose) -> tuple[Place, ...]:
        """Return the intruders that a robot sees, those on points of its footprint, nearest first.

        They are at most `MAX_CONTACTS`. The pose is the robot's true one.
        """
        if not self._intruders:
            return ()
        here = [intruder.place for intruder in self._intruders if intruder.is_there(tick * self._step)]
        if not here:
            return ()
        sent = as_received(pose)
        view = self._footprint.visible(sent)
        spots = [place for place in here if view.shows(*self._footprint.terrain.point_at(*place))]
        # By distance and then by place, so that of equally near ones the same are reported everywhere.
        return tuple(sorted(spots, key=lambda place: (math.dist(place, (sent.x, sent.y)), place))[:MAX_CONTACTS])
