"""The inputs from which every body is built."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from agent.chance import Draw
    from agent.routes.ground import Ground
    from patrol.scenario import BodyLengths, PatrolSpec, RobotSpec


@dataclass(frozen=True, slots=True)
class BodySetup:
    """The inputs from which a body is built."""

    spec: RobotSpec
    radii: Mapping[int, float]  # by robot number, of the whole fleet, m
    strides: Mapping[int, float]  # longest way in one step, likewise, m
    step: float  # s per tick
    patrol: PatrolSpec
    lengths: BodyLengths
    ground: Ground
    psi: NDArray[np.float32] | None  # float32 (h, w) of `psi_field`; None for no refinement of goals
    chance: Draw
    sees_all_round: bool  # the sensor sees the same whichever way the body faces
