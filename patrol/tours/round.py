"""A round: a closed tour laid out over the ground that it shows, so that a robot can follow it by what is left to see.

Each patrolled point belongs to a place of the tour from which it is seen. Few places have points: the *stops*. They are
chosen in the order of the tour. Each lies shortly before a point goes out of sight that is seen from no earlier stop.
So a robot may cut the corner where it has seen all points of the next stops; one that has missed a point knows from
where it would be seen.

Bodies pass a little beside the places of a tour, cars most of all. So a point belongs to the first stop that sees it
also from a little before and after, or to the nearest stop that sees it at all.

A *station* is a stretch of a round with the stops on it: what a patrol plans with that does not follow the tour. A
robot that drives along it sees all points that belong to it, so a station is visited as one.

    round      . s . . s . . . . . s . s . .      places; s: a stop, a place with points
    stations     |-----|           |---|
"""

from __future__ import annotations

import math
import zlib
from contextlib import suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from patrol.files.whole_file import replacing
from patrol.ground.fields import load_grid, save_grids
from patrol.ground.terrain import BoolGrid, Terrain
from patrol.ground.ways import framed, lengths_among
from patrol.tours.cover import Looks

if TYPE_CHECKING:
    from patrol.ground.footprint import Footprint


@dataclass(frozen=True, slots=True)
class Tour:
    """A closed tour, straight from each corner to the next, and from the last to the first."""

    length_m: float
    way: tuple[tuple[float, float], ...]  # corners in order, x and y in m
    looks: tuple[tuple[float, float], ...] = ()  # aside, in order: how far along the tour, m, and the heading, rad
    turned: float = 0.0  # by which a robot turns for these, rad

    def cost_m(self, radius: float) -> float:
        """Return the length, m, with the way that the wheels of a body of a radius (m) drive while they turn."""
        return self.length_m + self.turned * radius


PLACES = 0.02
"""Distance of the places of a round, as a share of the sensor's range; at least one point."""

SLACK = 0.075
"""How far before and after a place a point has to be seen as well, as a share of the sensor's range."""

ARRAYS = ("places", "along", "points", "place_of", "stands", "headings", "spots", "begins", "apart_m", "around")

Flat = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Round:
    """A closed tour through places, the points (flat indices) that are to be seen from each, and its stations."""

    length_m: float
    places: Flat  # (n,), the point of each place, in the order of the tour
    along: NDArray[np.float64]  # (n,), length of the tour up to each place, m; ascending from 0
    points: Flat  # (p,), the patrolled points, by the place to which they belong
    place_of: Flat  # (p,), the place of each of them, ascending
    stands: Flat  # (p,), the point to stand on to see each: its place, or its own post where no place sees it
    headings: NDArray[np.float64]  # (n,), from each place, rad; (0,) for a sensor that looks all round
    spots: Flat  # (s,), flat index of a point in the middle of each station
    begins: Flat  # (s + 1,), where each station's points begin in `points`, and where the last one's end
    apart_m: NDArray[np.float64]  # (s, s), as of `ways_between`; (0, 0) for more than `MOST_STATIONS`
    around: NDArray[np.int32]  # (height, width), the station to which each point of the terrain belongs; -1 for none

    def save(self, folder: Path) -> None:
        """Write the arrays as .npy files into a folder, which is made when missing."""
        save_grids(folder, self, ("length_m", *ARRAYS))

    @staticmethod
    def load(folder: Path) -> Round:
        """Load what `save` wrote, memory-mapped and read-only."""
        return Round(float(load_grid(folder / "length_m.npy")), *(load_grid(folder / f"{name}.npy") for name in ARRAYS))


def lay_out(
    terrain: Terrain,
    reach: BoolGrid,
    ground: BoolGrid,
    proxy: NDArray[np.int32],
    footprint: Footprint,
    tour: Tour,
    file: Path | None = None,
) -> Round:
    """Lay a tour out over ground that is all seen from it; a sensor may have to look aside as the tour says.

    `reach` marks where the body's centre may be; `proxy` holds the flat index of the post of each point on which no
    body fits. `file`, of the same arguments alone, keeps what takes longest to compute; it need not exist.
    """
    width = terrain.width
    places, along, headings, length_m = places_with_looks(
        terrain, reach, tour, max(terrain.point, PLACES * footprint.range_m)
    )
    if footprint.all_round:
        headings = np.empty(0)
    known = _read_kept(file, int(np.count_nonzero(ground)), len(places))
    if known is None:
        looks = Looks(terrain, footprint)
        owner = _assign_stops(terrain, ground, places, along, headings, looks, SLACK * footprint.range_m)
    else:
        owner = np.full(terrain.shape, -1, dtype=np.int64)
        owner[ground] = known[0]
    stops = owner[ground].astype(np.min_scalar_type(-len(places)))
    flat_owner = owner.reshape(-1)
    stands = np.where(flat_owner >= 0, places[np.maximum(flat_owner, 0)], -1)
    for point in np.flatnonzero(ground.reshape(-1) & (flat_owner < 0)).tolist():
        stands[point] = point if reach.flat[point] else int(proxy.flat[point])
        row, col = divmod(int(stands[point]), width)
        flat_owner[point] = np.argmin((places // width - row) ** 2 + (places % width - col) ** 2)
    points = np.flatnonzero(ground.reshape(-1) & (stands >= 0))
    points = points[np.argsort(flat_owner[points], kind="stable")]
    place_of = flat_owner[points]
    spots, begins, around = _find_stations(terrain, places, along, headings, points, place_of, footprint.range_m)
    size = len(spots) if len(spots) <= MOST_STATIONS else 0
    apart_m = np.empty((0, 0)) if known is None else known[1]
    if is_new := known is None or apart_m.shape != (size, size):
        apart_m = ways_between(terrain, reach, spots[:size], footprint.range_m)
    if file is not None and is_new:
        with suppress(OSError):
            file.parent.mkdir(parents=True, exist_ok=True)
            with replacing(file) as part, part.open("wb") as output:
                np.savez_compressed(output, stops=stops, apart_m=apart_m)
    return Round(length_m, places, along, points, place_of, stands[points], headings, spots, begins, apart_m, around)


def _read_kept(file: Path | None, points: int, places: int) -> tuple[NDArray[np.int64], NDArray[np.float64]] | None:
    """Return the stop of each point, and the ways between stations in m, of a file; None where it holds none."""
    if file is None:
        return None
    try:
        arrays = np.load(BytesIO(file.read_bytes()))
        stops, apart_m = arrays["stops"], arrays["apart_m"]
    except (OSError, ValueError, LookupError, EOFError, BadZipFile, zlib.error, RuntimeError, MemoryError):
        return None
    if stops.shape != (points,) or stops.dtype.kind != "i" or stops.min() < -1 or not 0 <= stops.max() < places:
        return None
    if apart_m.dtype != np.float64 or apart_m.ndim != 2 or not (apart_m >= 0.0).all():
        return None
    return stops.astype(np.int64), apart_m


def _assign_stops(
    terrain: Terrain,
    ground: BoolGrid,
    places: Flat,
    along: NDArray[np.float64],
    headings: NDArray[np.float64],
    looks: Looks,
    slack_m: float,
) -> Flat:
    """Return the place to which each patrolled point belongs, int64 (height, width); -1 where no place sees it."""
    window = np.zeros(terrain.shape, dtype=np.bool_)

    def look(number: int) -> tuple[slice, slice, BoolGrid]:
        """Return what is seen from a place."""
        return looks.window(int(places[number]), 1, float(headings[number]) if headings.size else None)

    def sees(number: int, rows: slice, cols: slice) -> BoolGrid:
        """Return which points of a window are seen from a place."""
        own_rows, own_cols, mask = look(number)
        window[own_rows, own_cols] = mask
        within = window[rows, cols].copy()
        window[own_rows, own_cols] = False
        return within

    # The last places in a row from which each point is seen.
    first = np.full(terrain.shape, -1, dtype=np.int64)
    last = np.full(terrain.shape, -2, dtype=np.int64)
    for number in range(len(places)):
        rows, cols, mask = look(number)
        mask = mask & ground[rows, cols]
        first[rows, cols][mask & (last[rows, cols] != number - 1)] = number
        last[rows, cols][mask] = number
    before = np.searchsorted(along, along - slack_m)
    after = np.minimum(np.searchsorted(along, along + slack_m), len(places) - 1)
    stop_of = np.where(last >= 0, np.maximum(first, before[np.maximum(last, 0)]), -1)

    owner = np.full(terrain.shape, -1, dtype=np.int64)
    nearest = np.full(terrain.shape, np.iinfo(np.int64).max, dtype=np.int64)
    is_sure = np.zeros(terrain.shape, dtype=np.bool_)
    points = np.flatnonzero(stop_of >= 0)
    points = points[np.argsort(stop_of.flat[points], kind="stable")]
    numbers, begins = np.unique(stop_of.flat[points], return_index=True)
    for number, due_there in zip(numbers.tolist(), np.split(points, begins[1:]), strict=True):
        if (owner.flat[due_there] >= 0).all():
            continue
        rows, cols, mask = look(number)
        row, col = divmod(int(places[number]), terrain.width)
        up, across = np.arange(terrain.height)[rows] - row, np.arange(terrain.width)[cols] - col
        off = up[:, None] ** 2 + across**2
        free = mask & ground[rows, cols] & ~is_sure[rows, cols]
        nearer = free & (off < nearest[rows, cols])
        owner[rows, cols][nearer], nearest[rows, cols][nearer] = number, off[nearer]
        sure = free & sees(before[number], rows, cols) & sees(after[number], rows, cols)
        owner[rows, cols][sure], is_sure[rows, cols][sure] = number, True
    return owner


Places = tuple[Flat, NDArray[np.float64], NDArray[np.float64], float]
"""Points of a tour, how far along it they lie in m, the headings in which a robot looks from there in rad, and the
tour's length in m."""


def places_with_looks(terrain: Terrain, reach: BoolGrid, tour: Tour, spacing: float) -> Places:
    """Return the points of a tour at most a spacing (m) apart, and those from which it looks aside."""
    places, along, headings, length_m = places_of(terrain, reach, tour, spacing)
    if not tour.looks:
        return places, along, headings, length_m
    looks_m, aside = np.array(tour.looks).T
    before = np.searchsorted(along, looks_m + ROUNDED_M)
    headings = np.insert(headings, before, aside)
    return (
        np.insert(places, before, places[before - 1]),
        np.insert(along, before, along[before - 1]),
        headings,
        length_m,
    )


def places_of(terrain: Terrain, reach: BoolGrid, tour: Tour, spacing: float) -> Places:
    """Return the points of a tour at most a spacing (m) apart, for a robot that looks ahead."""
    places: list[int] = []
    along: list[float] = []
    headings: list[float] = []
    passed = 0.0
    for (x, y), (to_x, to_y) in zip(tour.way, [*tour.way[1:], tour.way[0]], strict=True):
        length = math.dist((x, y), (to_x, to_y))
        count = max(1, math.ceil(length / spacing))
        for part in range(count):
            share = part / count
            row, col = terrain.point_at(x + share * (to_x - x), y + share * (to_y - y))
            flat = row * terrain.width + col
            if reach[row, col] and (not places or places[-1] != flat):
                places.append(flat)
                along.append(passed + share * length)
                headings.append(math.atan2(to_y - y, to_x - x))
        passed += length
    return np.array(places, dtype=np.int64), np.array(along), np.array(headings), passed


STRETCH = 0.05
"""Length of a station, as a share of the sensor's range."""

MOST_STATIONS = 2_000
"""Stations of the largest round that knows the ways between all of them: the matrix grows with the square."""

TURN = 0.4
"""Largest angle between the headings of a station's stops, rad."""

ROUNDED_M = 1e-6
"""A place that lies so little before a look is the same, m."""

NEAR = 4.0
"""Length of the ways between stations that are searched for first, in ranges of the sensor."""


def _find_stations(
    terrain: Terrain,
    places: Flat,
    along: NDArray[np.float64],
    headings: NDArray[np.float64],
    points: Flat,
    place_of: Flat,
    range_m: float,
) -> tuple[Flat, Flat, NDArray[np.int32]]:
    """Put the stops of a round together into stations; return what a round says as `spots`, `begins` and `around`."""
    stops, firsts = np.unique(place_of, return_index=True)
    facing = headings[stops] if headings.size else np.zeros(len(stops))
    heads: list[int] = []
    for number, at_m in enumerate(along[stops].tolist()):
        if (
            not heads
            or at_m - along[stops[heads[-1]]] > STRETCH * range_m
            or abs(math.remainder(facing[number] - facing[heads[-1]], math.tau)) > TURN
        ):
            heads.append(number)
    ends = [*heads[1:], len(stops)]
    middles = [(head + end) // 2 for head, end in zip(heads, ends, strict=True)]
    spots = places[stops[middles]]
    begins = np.append(firsts[heads], len(place_of))
    around = np.full(terrain.shape, -1, dtype=np.int32)
    around.flat[points] = np.repeat(np.arange(len(spots), dtype=np.int32), np.diff(begins))
    return spots, begins, around


def ways_between(terrain: Terrain, reach: BoolGrid, spots: Flat, range_m: float) -> NDArray[np.float64]:
    """Return how long the way from each station to each is, m; infinite where no way leads.

    Ways of more than `NEAR` ranges of the sensor may be those by other stations, and then are a little longer.
    """
    from patrol.kernels.ways import FAR  # here: most processes need no ways

    rows, cols = np.divmod(spots, terrain.width)
    distinct, index = np.unique((rows + 1) * (terrain.width + 2) + cols + 1, return_inverse=True)
    between = lengths_among(framed(reach), distinct, math.ceil(100.0 * NEAR * range_m / terrain.point))
    lengths = between[np.ix_(index, index)]
    return np.where(lengths == FAR, np.inf, lengths * (0.01 * terrain.point))
