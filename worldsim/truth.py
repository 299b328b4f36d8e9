"""The true fog: what the whole fleet has really seen, from the poses of all living bodies."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from patrol.ground.fog import Fog
from patrol.ground.footprint import Footprint
from patrol.pose import Pose
from patrol.radio.message import Position


def as_sent(number: int, tick: int, step: float, pose: Pose) -> Pose:
    """A pose as others hear it (cm, mrad). Every footprint is computed from it, so truth and belief agree."""
    return Position.of(number, tick, tick * step, pose).pose


class Truth:
    """The fog over the patrolled area as it really is.

    patrolled: bool (height, width), the points that count. All ages are in ticks of `step` seconds.
    """

    def __init__(self, footprint: Footprint, patrolled: NDArray[np.bool_], step: float) -> None:
        self.footprint = footprint
        self.fog = Fog(patrolled)
        self._step = step

    def observe(self, tick: int, poses: Iterable[tuple[int, Pose]]) -> None:
        """Everyone in `poses` (robot number, pose) looks around once, in that order."""
        for number, pose in poses:
            self.fog.observe(self.footprint.visible(as_sent(number, tick, self._step, pose)), tick)
