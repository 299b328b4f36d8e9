"""The other robots, as they were heard, and where they are expected some ticks after their last frame.

All robots with a frame predict the same from it, its sender too. A frame with a trail shows how far its sender has come
per tick, and the prediction goes on like that in a straight line, to the first wall; a frame without one leaves its
sender where it was. After as many ticks as a robot may be silent the prediction stands still.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from patrol.ground.swept_path import free_fraction
from patrol.ground.terrain import Terrain
from patrol.pose import Pose
from patrol.radio.message import Position, cm_to_m


@dataclass(frozen=True, slots=True)
class Peer:
    """Another robot."""

    sequence: int  # its newest
    pose: Pose  # at that sequence, m and rad
    tick: int  # at which that was heard


class Columns(NamedTuple):
    """Some robots, ascending by number. The arrays are only read."""

    numbers: NDArray[np.int64]  # (n,)
    sequences: NDArray[np.int64]  # (n,), their newest
    ticks: NDArray[np.int64]  # (n,), when those were heard
    places: NDArray[np.float64]  # (n, 2), x and y in m


def columns_of(peers: Mapping[int, Peer]) -> Columns:
    """Return some robots in columns; a mapping that has them as `columns` gives them faster."""
    columns: Columns | None = getattr(peers, "columns", None)
    if columns is not None:
        return columns
    ordered = sorted(peers.items())
    rows = [(number, peer.sequence, peer.tick) for number, peer in ordered]
    numbers, sequences, ticks = np.array(rows, dtype=np.int64).reshape(-1, 3).T.copy()
    places = [(peer.pose.x, peer.pose.y) for _, peer in ordered]
    return Columns(numbers, sequences, ticks, np.array(places, dtype=np.float64).reshape(-1, 2))


def places_of(peers: Mapping[int, Peer]) -> NDArray[np.float64]:
    """Return the places of some robots, float64 (n, 2), x and y in m, ascending by number."""
    return columns_of(peers).places


# The predicted place is for the centre of a body: a point passes wherever some body does.
_POINT = 1e-6


def go_on(terrain: Terrain, start: Pose, moved: tuple[float, float], ahead: float) -> Pose:
    """Return the pose after `ahead` more of a movement (x and y in m), or at the first wall.

    For example, three more movements of (0.5, 0.0) from (1, 1) lead to (2.5, 1), and to (1.75, 1) with a wall at x =
    1.75.
    """
    end = Pose(start.x + ahead * moved[0], start.y + ahead * moved[1], start.heading)
    share = free_fraction(terrain, start, end, _POINT)
    return Pose(start.x + share * (end.x - start.x), start.y + share * (end.y - start.y), start.heading)


class Predictor:
    """Predicts robots on one terrain."""

    def __init__(self, terrain: Terrain, trail_every: int, horizon: int) -> None:
        """Make a predictor with the knowledge of all robots of a fleet.

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
        # A trail's step takes `trail_every` ticks.
        ahead = min(ticks, self._horizon) / self._trail_every
        return go_on(self._terrain, start, (-cm_to_m(back_x), -cm_to_m(back_y)), ahead)

    def error(self, last: Position, now: Position) -> float:
        """Return the distance, in m, between the place predicted from the sender's last frame and the present one."""
        predicted = self.pose(last, now.sequence - last.sequence)
        return math.hypot(predicted.x - now.pose.x, predicted.y - now.pose.y)
