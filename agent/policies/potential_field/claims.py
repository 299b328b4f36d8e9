"""Claims: a point pulls mainly the robot that is nearest to it.

The paper leaves open that two robots drift onto the same path, and found repulsion harmful. Positions alone are
enough to do better: the force of each point is scaled by 1 / (1 + exp((d - d') / s)), where d is this robot's way to
it, d' the way of the nearest other robot, and s a width. Nothing more is sent, and with no communication the factor
is 1.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

WIDTHS = 40.0
"""Widths beyond which a claim is as good as settled; e^-40 of the force is left, so that something always pulls."""


def share_table(width_m: float, point: float) -> NDArray[np.float64]:
    """What is left of a force, float64 (2 m + 1,), by how much farther off the robot is than its nearest rival.

    The index is the difference of their path lengths in hundredths of a point, plus m. width_m, point: m.
    """
    width = 100.0 * width_m / point
    reach = round(WIDTHS * width)
    return 1.0 / (1.0 + np.exp(np.arange(-reach, reach + 1) / width))
