"""The intruders that robots see: reported by the world, recomputed by the verdict."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from patrol.radio.message import MAX_CONTACTS, as_received

if TYPE_CHECKING:
    from patrol.ground.footprint import Footprint
    from patrol.pose import Pose
    from patrol.scenario import Scenario

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
        return tuple(sorted(spots, key=lambda place: (math.dist(place, (sent.x, sent.y)), place))[:MAX_CONTACTS])
