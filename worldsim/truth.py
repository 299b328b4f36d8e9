"""The true fog: the points that the whole fleet has seen, from the true poses of all robots that are alive."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from patrol.ground.fog import Fog
from patrol.ground.footprint import Footprint
from patrol.pose import Pose
from patrol.radio.message import as_received

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
