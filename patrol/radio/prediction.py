"""A robot's place some ticks after its last frame, as all robots with that frame predict it: its sender too.

A frame with a trail shows how far its sender has come per tick, and the prediction goes on like that in a straight
line, to the first wall; a frame without one leaves its sender where it was. After as many ticks as a robot may be
silent the prediction stands still.
"""

from __future__ import annotations

import math

from patrol.ground.swept_path import free_fraction
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.radio.message import Position, cm_to_m

# The predicted place is for the centre of a body: a point passes wherever some body does.
_POINT = 1e-6


class Predictor:
    """Predicts robots on one terrain."""

    def __init__(self, terrain: Terrain, trail_every: int, horizon: int) -> None:
        """Make a predictor with what all robots of a fleet know.

        `trail_every` is the number of ticks between the places of a trail, and `horizon` the ticks after which a
        prediction stands still.
        """
        self._terrain = terrain
        self._trail_every = trail_every
        self._horizon = horizon

    def pose(self, last: Position, ticks: int) -> Pose:
        """Predict the pose some ticks after a frame; the heading is that of the frame.

        The frame's trail is as long as can be true (`Intake.said`).
        """
        start = last.pose
        if not last.trail or ticks <= 0:
            return start
        back_x, back_y = last.trail[0]
        ahead = min(ticks, self._horizon) / self._trail_every
        end = Pose(start.x - ahead * cm_to_m(back_x), start.y - ahead * cm_to_m(back_y), start.heading)
        share = free_fraction(self._terrain, start, end, _POINT)
        return Pose(start.x + share * (end.x - start.x), start.y + share * (end.y - start.y), start.heading)

    def error(self, last: Position, now: Position) -> float:
        """Return the distance, in m, between the place predicted from the sender's last frame and the present one."""
        predicted = self.pose(last, now.sequence - last.sequence)
        return math.hypot(predicted.x - now.pose.x, predicted.y - now.pose.y)
