"""The true fog: what the whole fleet has really seen, from the poses of all living bodies."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from patrol.ground.fog import Fog
from patrol.ground.footprint import Footprint
from patrol.pose import Pose
from patrol.radio.message import as_received


class Truth:
    """The fog over the patrolled area as it really is.

    patrolled: bool (height, width), the points that count. All ages are in ticks.
    """

    def __init__(self, footprint: Footprint, patrolled: NDArray[np.bool_]) -> None:
        self.footprint = footprint
        self.fog = Fog(patrolled)

    def observe(self, tick: int, poses: Iterable[tuple[int, Pose]]) -> None:
        """Everyone in `poses` (robot number, pose) looks around once, in that order, from the pose that others hear."""
        for _, pose in poses:
            self.fog.observe(self.footprint.visible(as_received(pose)), tick)
