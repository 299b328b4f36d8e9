"""The settings of the moving intruder. This module loads no kernel, so that commands may name their defaults."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from patrol.errors import BadInput, quoted
from patrol.ground.shapes import Polygon

BEGIN_S = 100.0
"""The beginning of a run, which is like no later moment, s."""

PAST_S = 80.0
"""Time from which moments are taken at least, s: enough for all of them with one robot."""

KNOWLEDGE = {
    "future": "knows what will be seen: it has the seed or key",
    "code": "has the scenario and the code, but neither seed nor key",
    "similar": "watches: expects what followed similar moments",
    "each": "watches: expects each robot's usual next turns",
    "picture": "knows what is seen now",
    "blind": "knows nothing, and takes the shortest way",
}
"""What an intruder with each predictor knows, in words; `code` plays only where it was asked for."""

WATCHING = ("similar", "each")
"""The predictors that only watch: nothing else is needed to play them against a real patrol."""

LIMITS = {
    "speed": (0.1, 10.0),
    "stay_s": (0.0, 600.0),
    "within_s": (1.0, 600.0),
    "depth_m": (0.0, 1e6),
    "attempts": (1, 100_000),
}
"""Least and greatest value of settings of `Infiltrator`, so that a game ends and fits into memory."""


@dataclass(frozen=True, slots=True)
class Infiltrator:
    """The moving intruder."""

    speed: float = 2.0  # m/s
    stay_s: float = 10.0  # how long it must stay at its target
    within_s: float = 120.0  # from the moment at which it plans first, the time until its stay must be over
    depth_m: float = 20.0  # least length of the way from an entry to a target; at most half the greatest there is
    attempts: int = 150
    seed: int = 1  # of the attempts' moments and targets
    # where it may enter: at the edge of the ground (the terrain's, or where walls surround it the outermost points of
    # rows and columns), at doors between rooms, or in a polygon, m
    entries: Literal["edge", "doors"] | Polygon = "edge"
    zone: str | None = None  # name of the zone in which its targets are, however deep; None for all ground

    def __post_init__(self) -> None:
        """Raise BadInput for a setting out of its limits, or a stay that does not fit into the time."""
        for name, (least, most) in LIMITS.items():
            value = getattr(self, name)
            if not (isinstance(value, int | float) and least <= value <= most):
                raise BadInput(f"{name} = {quoted(value)}: expected a number from {least:g} to {most:g}")
        for name in ("attempts", "seed"):
            if not isinstance(getattr(self, name), int):
                raise BadInput(f"{name} = {quoted(getattr(self, name))}: expected a whole number")
        if isinstance(self.entries, str) and self.entries not in ("edge", "doors"):
            raise BadInput(f"entries = {quoted(self.entries)}: expected edge, doors, or the corners of a polygon")
        if self.stay_s >= self.within_s:
            raise BadInput(f"stay_s = {self.stay_s:g}: does not fit into {self.within_s:g} s; choose a shorter stay")

    @property
    def least_s(self) -> float:
        """The shortest run that it can be played on, s."""
        return 2.0 * (BEGIN_S + PAST_S + self.within_s)
