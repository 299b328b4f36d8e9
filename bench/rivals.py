"""The libraries that our kernels are compared with, and how far their results agree with ours.

None is needed to use or to test fogwatch. `INSTALL` installs them; one that is missing is named and left out.

    python -m bench.rivals
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import metadata
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.grounds import GROUNDS
from bench.ours import WholeWave
from patrol.ground.terrain import BoolGrid

INSTALL = "make rivals"
DILATATION_PACKAGE = "scipy"

SHORT = 20.0
"""Lengths below this many points are compared as if they were this long: the start itself has a width."""

Floats = NDArray[np.float64]


class Disagreement(Exception):
    """A rival's result is not ours; the message says by how much in one line."""


@dataclass(frozen=True, slots=True)
class WaveRival:
    """A library that finds path lengths from one point over a grid.

    Attributes:
        package: What installs it.
        module: What is imported.
        begin: Takes the module, the open points, bool (h, w), and the start, and returns the call to time, which
            returns the lengths in an array (h, w).
        unit: What its lengths are divided by to be in points.
        low: A length is at least this share of ours, less two points.
        high: And at most this, plus two points.
        note: How its definition of a length differs from ours.
    """

    package: str
    module: str
    begin: Callable[[Any, BoolGrid, tuple[int, int]], Callable[[], Any]]
    unit: float
    low: float
    high: float
    note: str


def _dijkstra3d(module: Any, is_open: BoolGrid, start: tuple[int, int]) -> Callable[[], Any]:
    labels = np.asfortranarray(is_open.astype(np.uint8))
    return lambda: module.euclidean_distance_field(labels, start)


def _tcod(module: Any, is_open: BoolGrid, start: tuple[int, int]) -> Callable[[], Any]:
    cost = is_open.astype(np.int8)
    distance = module.maxarray(is_open.shape, dtype=np.int32)

    def run() -> Any:
        distance[:] = np.iinfo(np.int32).max
        distance[start] = 0
        return module.dijkstra2d(distance, cost, 100, 141, out=distance)

    return run


def _mcp(module: Any, is_open: BoolGrid, start: tuple[int, int]) -> Callable[[], Any]:
    paths = module.MCP_Geometric(np.where(is_open, 1.0, -1.0), fully_connected=True)
    return lambda: paths.find_costs([start])[0]  # which forgets the start before


def _fast_marching(module: Any, is_open: BoolGrid, start: tuple[int, int]) -> Callable[[], Any]:
    front = np.ma.MaskedArray(np.ones(is_open.shape), ~is_open)
    front[start] = -1.0
    speed = np.ones(is_open.shape)
    return lambda: module.travel_time(front, speed)


_DIAGONAL = math.sqrt(2.0) / 1.41
"""Ratio of a diagonal step that counts the root of 2 to one that counts 1.41 points."""

WAVES: Mapping[str, WaveRival] = {
    "dijkstra3d, distance field": WaveRival(
        "dijkstra3d",
        "dijkstra3d",
        _dijkstra3d,
        1.0,
        0.97,
        _DIAGONAL,
        "diagonal steps count the root of 2 and cut corners; no bends",
    ),
    "tcod, dijkstra2d": WaveRival(
        "tcod", "tcod.path", _tcod, 100.0, 0.97, 1.0, "diagonal steps count 1.41 as ours, and cut corners; no bends"
    ),
    "scikit-image, MCP_Geometric": WaveRival(
        "scikit-image",
        "skimage.graph",
        _mcp,
        1.0,
        0.97,
        _DIAGONAL,
        "diagonal steps count the root of 2 and cut corners; a traceback instead of bends",
    ),
    "scikit-fmm, travel time": WaveRival(
        "scikit-fmm",
        "skfmm",
        _fast_marching,
        1.0,
        0.9,
        1.02,
        "lengths in all directions instead of eight, approximate; no bends",
    ),
}


def version_of(package: str) -> str:
    """Return the version of a package; empty where it is not installed.

    Args:
        package: What installs it.
    """
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return ""


def checked_wave(name: str, is_open: BoolGrid, start: tuple[int, int]) -> tuple[Callable[[], Any], str]:
    """Prepare a rival's wave, and check its lengths against ours.

    Args:
        name: One of `WAVES`, which is installed.
        is_open: bool (h, w), where the robot's centre may be.
        start: Row and column of an open point.

    Returns:
        The call to time, and how far the lengths agree.

    Raises:
        Disagreement: They are further apart than the two definitions allow.
    """
    rival = WAVES[name]
    call = rival.begin(importlib.import_module(rival.module), is_open, start)
    lengths = np.asarray(np.ma.filled(call(), np.inf), dtype=np.float64) / rival.unit
    return call, agreement(name, rival, WholeWave(is_open, start).lengths(), lengths)


def agreement(name: str, rival: WaveRival, ours: Floats, theirs: Floats) -> str:
    """Compare a rival's lengths with ours, at all points to which we find a path.

    A rival that cuts corners may find paths to other points, too.

    Args:
        name: The rival's.
        rival: What its lengths are.
        ours: float64 (h, w), in points, infinite where no path leads.
        theirs: float64 (h, w), the same of the rival; not finite, or very large, where it finds no path.

    Returns:
        How far they agree, for people, such as "lengths within 0.3 %".

    Raises:
        Disagreement: They are further apart than the two definitions allow.
    """
    known = np.isfinite(ours)
    own, other = ours[known], theirs[known]
    unlike = ~((other >= rival.low * own - 2.0) & (other <= rival.high * own + 2.0))
    if unlike.any():
        raise Disagreement(f"{name}: {np.count_nonzero(unlike)} of {own.size} lengths differ from ours beyond reason")
    if np.array_equal(own, other):
        return "lengths equal"
    apart = np.abs(own - other) / np.maximum(own, SHORT)
    return f"lengths within {100.0 * float(np.max(apart)):.2g} %"


def dilatation_rival(seen: NDArray[np.int32], is_open: BoolGrid, reach: int, tick: int) -> Callable[[], Any]:
    """Return the dilatation as scipy does it: its filters, in as many rounds as the window is wide where walls are.

    Args:
        seen: int32 (h, w), the tick at which each point was last seen.
        is_open: bool (h, w), the points over which staleness spreads.
        reach: Half-width of the window, in points.
        tick: Now.

    Returns:
        The call to time, which returns the ticks of the dilated ages in an array (h, w).

    Raises:
        ModuleNotFoundError: scipy is not installed.
    """
    from scipy import ndimage

    age = np.where(is_open, tick - seen + 1, 0).astype(np.uint16)
    if is_open.all():
        return lambda: tick + 1 - ndimage.maximum_filter(age, 2 * reach + 1, mode="constant").astype(np.int32)

    def rounds() -> Any:
        spread = age
        for number in range(reach):
            for axis in (1, 0) if number % 2 == 0 else (0, 1):
                spread = ndimage.maximum_filter1d(spread, 3, axis=axis, mode="constant") * is_open
        return tick + 1 - spread.astype(np.int32)

    return rounds


def main() -> None:
    """Print how far the lengths of the rivals that are installed agree with ours, on each ground."""
    for ground, make in GROUNDS.items():
        for name, rival in WAVES.items():
            if version := version_of(rival.package):
                print(f"{ground}: {name} {version}: {checked_wave(name, *make())[1]}; {rival.note}")
            else:
                print(f"{ground}: {name}: not installed: {INSTALL}")


if __name__ == "__main__":
    main()
