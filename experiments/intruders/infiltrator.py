"""The settings of the moving intruder. This module loads no kernel, so that commands may name their defaults."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Literal

from fogwatch.cli.options import option
from patrol.errors import BadInput, printable, quoted
from patrol.ground.shapes import Polygon

PANEL = "Moving intruder"
"""The panel of its settings in a command's help."""

_option = partial(option, panel=PANEL)

BEGIN_S = 100.0
"""The beginning of a run, which is like no later moment, s."""

PAST_S = 80.0
"""Time from which moments are taken at least, s: enough for all of them with one robot."""

KNOWLEDGE = {
    "future": "knows what will be seen: it has the seed or key",
    "code": "has the scenario and the code, but neither seed nor key",
    "watching": "watches: knows robots' usual turns and how old points get",
    "picture": "knows what is seen now",
    "blind": "knows nothing, and takes the shortest way",
}
"""The knowledge of an intruder with each predictor, in words; `code` plays only where it was asked for."""

WATCHING = "watching"
"""The predictor that only watches: nothing else is needed to play it against a real patrol."""

LIMITS = {
    "speed": (0.1, 10.0),
    "stay_s": (0.0, 600.0),
    "within_s": (1.0, 600.0),
    "depth_m": (0.0, 1e6),
    "attempts": (1, 100_000),
}
"""Least and greatest value of settings of `Infiltrator`, so that a game ends and fits into memory."""


def _read_entries(text: str) -> Literal["edge", "doors"] | list[tuple[float, float]]:
    """Read where it enters: edge, doors, or the corners of a polygon."""
    match text:
        case "edge" | "doors":
            return text
    corners = []
    for word in text.split():
        try:
            x, y = map(float, word.split(","))
        except ValueError:
            x = y = math.nan
        corners.append((x, y))
    if len(corners) < 3 or not all(math.isfinite(x) and math.isfinite(y) for x, y in corners):
        raise BadInput(f"--entries {printable(text)}: expected edge, doors, or three corners or more, '0,0 10,0 10,5'")
    return corners


@dataclass(frozen=True, slots=True)
class Infiltrator:
    """The moving intruder."""

    speed: Annotated[float, _option("M/S", "Its speed, m/s.")] = 2.0
    stay_s: Annotated[float, _option("S", "How long it must stay at its target, s.", "--stay")] = 10.0
    within_s: Annotated[float, _option("S", "Time from its first plan to the end of its stay, s.", "--within")] = 120.0
    depth_m: Annotated[
        float,
        _option("M", "Least length of the way from an entry to a target, m; at most half of the longest.", "--depth"),
    ] = 20.0
    # at the edge of the terrain, or where walls surround the ground at the outermost points of rows and columns
    entries: Annotated[
        Literal["edge", "doors"] | Polygon,
        _option(
            "WHERE",
            "Where it enters: edge (of the ground), doors (between rooms), or a polygon's corners, m, such as '0,0 "
            "10,0 10,5'.",
            parser=_read_entries,
        ),
    ] = "edge"
    zone: Annotated[
        str | None, _option("NAME", "Zone in which its targets are, at any depth (default: all ground).")
    ] = None
    attempts: Annotated[int, _option("N", "Number of attempts.")] = 150
    seed: Annotated[int, _option("N", "Seed of its moments and targets.")] = 1

    def __post_init__(self) -> None:
        """Raise BadInput for a setting out of its limits, or a stay that does not fit into the time."""
        for name, (lower, upper) in LIMITS.items():
            value = getattr(self, name)
            if not (isinstance(value, int | float) and lower <= value <= upper):
                raise BadInput(f"{name} = {quoted(value)}: expected a number from {lower:g} to {upper:g}")
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
