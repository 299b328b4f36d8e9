"""Stations: what a patrol plans with that does not follow the tour.

A station is a stretch of a round with the stops on it (`patrol.tours.round`). A robot that drives along it sees
all points that belong to it, so a station is visited as one.

    round      . s . . s . . . . . s . s . .      places; s: a stop, a place with points
    stations     |-----|           |---|
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.ground.fields import load_grid
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.ground.ways import framed, lengths_along

if TYPE_CHECKING:
    from patrol.tours.round import Round

STRETCH = 0.05
"""Length of a station, as a share of the sensor's range."""

NEAR = 4.0
"""Length of the ways between stations that are searched for first, in ranges of the sensor."""

ARRAYS = ("spots", "begins", "apart_m", "around")

Flat = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Stations:
    """The stations of a round."""

    spots: Flat  # (s,), flat index of a point in the middle of each station
    begins: Flat  # (s + 1,), where each station's points begin in `Round.points`, and where the last one's end
    apart_m: NDArray[np.float64]  # (s, s), length of the way from each to each; infinite where no way leads
    around: NDArray[np.int32]  # (height, width), the station to which each point of the terrain belongs; -1 for none

    def save(self, folder: Path) -> None:
        """Write the arrays as .npy files into a folder, which is made when missing."""
        folder.mkdir(parents=True, exist_ok=True)
        for name in ARRAYS:
            np.save(folder / f"{name}.npy", getattr(self, name))

    @staticmethod
    def load(folder: Path) -> Stations | None:
        """Load what `save` wrote, memory-mapped and read-only; None where it has written nothing."""
        return Stations(*(load_grid(folder / f"{name}.npy") for name in ARRAYS)) if folder.is_dir() else None


def stations_of(laid_out: Round, terrain: Terrain, reach: BoolGrid, range_m: float) -> Stations:
    """Put the stops of a round together into stations; `reach` marks where the body's centre may be."""
    along, place_of = laid_out.along, laid_out.place_of
    stops, firsts = np.unique(place_of, return_index=True)
    heads: list[int] = []
    for number, at_m in enumerate(along[stops].tolist()):
        if not heads or at_m - along[stops[heads[-1]]] > STRETCH * range_m:
            heads.append(number)
    ends = [*heads[1:], len(stops)]
    middles = [(head + end) // 2 for head, end in zip(heads, ends, strict=True)]
    spots = laid_out.places[stops[middles]]
    begins = np.append(firsts[heads], len(place_of))
    around = np.full(terrain.shape, -1, dtype=np.int32)
    around.flat[laid_out.points] = np.repeat(np.arange(len(spots), dtype=np.int32), np.diff(begins))
    return Stations(spots, begins, _distances_between(terrain, reach, spots, NEAR * range_m), around)


def _distances_between(terrain: Terrain, reach: BoolGrid, spots: Flat, near_m: float) -> NDArray[np.float64]:
    """Return the lengths of the ways between points, m."""
    from patrol.kernels.ways import FAR, lengths_between  # here: most processes need no ways

    rows, cols = np.divmod(spots, terrain.width)
    longest = 141 * reach.size
    if terrain.against.size:
        grids = (
            lengths_along(reach, terrain.against, [start], longest)
            for start in zip(rows.tolist(), cols.tolist(), strict=True)
        )
        lengths = np.array([grid[rows + 1, cols + 1] for grid in grids])
    else:
        is_open, _ = framed(reach, terrain.against)
        distinct, index = np.unique((rows + 1) * (terrain.width + 2) + cols + 1, return_inverse=True)
        between = np.empty((len(distinct), len(distinct)), dtype=np.int32)
        limit = math.ceil(100.0 * near_m / terrain.point)
        while lengths_between(is_open, distinct, limit, between) and limit <= longest:
            limit *= 2
        lengths = between[np.ix_(index, index)]
    return np.where(lengths == FAR, np.inf, lengths * (0.01 * terrain.point))
