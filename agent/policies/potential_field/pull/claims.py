"""Claims: a point mainly pulls the robot that is nearest to it.

The paper leaves open that two robots drift onto the same path, and found repulsion harmful. Positions alone allow
better: the force of each point is scaled by 1 / (1 + exp((d - d') / s)), where d is this robot's way to the point, d'
the way of the nearest other robot, and s a width. Nothing more is sent, and without communication the factor is 1.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

WIDTHS = 40.0
"""Number of widths beyond which a claim is decided; e^-40 of the force is left, so that there is always some pull."""


def share_table(width_m: float, point: float) -> NDArray[np.float64]:
    """Return the share that is left of a force, by how much farther away the robot is than its nearest rival.

    Args:
        width_m: s, m.
        point: Side of the terrain's points, m.

    Returns:
        float64 (2 m + 1,). The index is the difference of the path lengths, d - d', in hundredths of a point, plus m.
    """
    width = 100.0 * width_m / point
    reach = round(WIDTHS * width)
    return 1.0 / (1.0 + np.exp(np.arange(-reach, reach + 1) / width))
