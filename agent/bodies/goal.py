"""The goal in a direction: ahead of the robot, clipped to the free ground, refined (paper, step 7)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from agent.bodies.kernels.goal import free_run, refine
from agent.ports import Goal
from agent.routes.ground import Ground
from patrol.scenario import BodyLengths


class GoalFinder:
    """Finds the goal along a direction: the last free point of the ray up to the goal distance, then refined.

    Refinement takes the point with the lowest psi in a square around the goal (paper, "goal refinement"). Candidates
    are the points roughly in the chosen direction that a straight line reaches both from the goal and from the robot,
    since neither leg may cross a wall.
    """

    def __init__(self, lengths: BodyLengths, ground: Ground, psi: NDArray[np.float32] | None) -> None:
        """Convert the distances to points.

        Args:
            lengths: The goal distance and the side of the square, m (the paper's: 5.5 and 2).
            ground: Where the robot's centre may be.
            psi: float32 (h, w) of `agent.bodies.refine.psi_field`, or None for no refinement.
        """
        self._ground = ground
        self._psi = psi
        self._point = ground.terrain.point
        self._distance = lengths.goal_distance / self._point
        self._side = round(0.5 * lengths.refine_side / self._point)

    def along(self, bearing: float, row: int, col: int) -> Goal:
        """Return the goal in a direction.

        Args:
            bearing: The direction, rad.
            row: Row of the robot's open element in `Ground.state`.
            col: Column of the same element.

        Returns:
            The goal before and after refinement.
        """
        state = self._ground.state
        up, across = math.sin(bearing), math.cos(bearing)
        run = float(free_run(state, row + 0.5, col + 0.5, up, across, self._distance))
        goal_row, goal_col = math.floor(row + 0.5 + run * up), math.floor(col + 0.5 + run * across)
        goal = self._ground.centre(goal_row, goal_col)
        if self._psi is None:
            return Goal(goal, goal)
        best = refine(state, self._psi, goal_row, goal_col, row + 0.5, col + 0.5, up, across, self._side)
        refined = self._ground.centre(*divmod(int(best), state.shape[1]))
        return Goal(goal, refined)
