"""The goal in a direction: ahead of the robot, clipped to the free ground, refined (paper, step 7).

As printed, the goal may lie behind a wall, and so may the point that refinement chooses (`patrol.scenario.policies`).
"""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from agent.kernels.goal import free_run, refine
from agent.ports import Goal
from agent.routes.ground import Ground
from patrol.scenario import BodyLengths
from patrol.scenario.policies import PaperRule


class GoalFinder:
    """Finds the goal along a direction: the last free point of the ray up to the goal distance, then refined.

    Refinement takes the point with the lowest psi in a square around the goal (paper, "goal refinement"). Candidates
    are the points roughly in the chosen direction that a straight line reaches both from the goal and from the robot,
    since neither leg may cross a wall.
    """

    def __init__(
        self,
        lengths: BodyLengths,
        ground: Ground,
        psi: NDArray[np.float32] | None,
        paper_rules: Collection[PaperRule] = (),
    ) -> None:
        """Convert the distances to points; goals are not refined if `psi` is None.

        `psi` is that of `agent.bodies.refine.psi_field`. The paper's lengths are 5.5 m for the goal distance and 2 m
        for the side of the square. Of `paper_rules`, ``far-goal`` clips no goal, and ``whole-square`` refines to any
        point of the square.
        """
        self._clips = "far-goal" not in paper_rules
        self._whole_square = "whole-square" in paper_rules
        self._ground = ground
        self._psi = psi
        self._point = ground.terrain.point
        self._distance = lengths.goal_distance / self._point
        self._side = round(0.5 * lengths.refine_side / self._point)

    def along(self, bearing: float, row: int, col: int) -> Goal:
        """Return the goal in a direction (rad), before and after refinement.

        `row` and `col` are those of the robot's open element in `Ground.state`.
        """
        state = self._ground.state
        up, across = math.sin(bearing), math.cos(bearing)
        run = self._distance
        if self._clips:
            run = float(free_run(state, row + 0.5, col + 0.5, up, across, run))
        goal_row, goal_col = math.floor(row + 0.5 + run * up), math.floor(col + 0.5 + run * across)
        goal = self._ground.centre(goal_row, goal_col)
        if self._psi is None:
            return Goal(goal, goal)
        here, towards = (row + 0.5, col + 0.5), (up, across)
        best = refine(state, self._psi, goal_row, goal_col, *here, *towards, self._side, self._whole_square)
        return Goal(goal, goal if best < 0 else self._ground.centre(*divmod(int(best), state.shape[1])))
