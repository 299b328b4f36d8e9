"""The best tour found: how small a fleet that knew everything could keep the MFoW, as a yardstick for patrols.

A tour is computed once for each ground, body and sensor, and kept in the user's cache folder, beside what takes longest
of laying it out as a round; a file there that is missing or damaged is made again. Those of the built-in terrains, for
the default body, come with the code.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.files.whole_file import write_whole
from patrol.ground.cspace import parts_of
from patrol.ground.fields import StaticFields, anchor
from patrol.ground.terrain import BoolGrid, frozen_grid
from patrol.kernel_cache import user_cache
from patrol.latest import latest
from patrol.prepare import sensor_footprint
from patrol.scenario.sections import BUILT_IN_SENSORS
from patrol.tours.round import Round, Tour, lay_out

if TYPE_CHECKING:
    from patrol.ground.footprint import Footprint
    from patrol.ground.terrain import Terrain
    from patrol.prepare import Prepared
    from patrol.scenario import Scenario
    from patrol.scenario.sections import RobotSpec, SensorSpec


@dataclass(frozen=True, eq=False, slots=True)
class OwnGround:
    """The ground that a robot can reach and see by itself, in the part of the terrain that it starts in; read-only."""

    reach: BoolGrid  # the connected part of the reachable ground
    patrolled: BoolGrid  # the patrolled points in it, and those that are best seen from it
    proxy: NDArray[np.int32]  # as in `StaticFields`


def own_grounds(prepared: Prepared) -> dict[int, OwnGround]:
    """Find the ground that each robot can reach and see by itself; those of one radius in one part share an object."""
    terrain = prepared.terrain
    labels: dict[int, NDArray[np.int32]] = {}
    own_by_part: dict[tuple[int, int], OwnGround] = {}
    grounds = {}
    for spec, start in zip(prepared.scenario.roster, prepared.starts, strict=True):
        fields = prepared.fields[spec.number]
        body = id(fields)
        if body not in labels:
            labels[body], _ = parts_of(np.ascontiguousarray(fields.reach))
        start_point = anchor(terrain, fields.cspace, start.x, start.y)
        part = 0 if start_point is None else int(labels[body][start_point])
        if (body, part) not in own_by_part:
            reach = frozen_grid(labels[body] == part) if part else fields.reach
            own_by_part[body, part] = OwnGround(reach, _seen_from(fields, reach), fields.proxy)
        grounds[spec.number] = own_by_part[body, part]
    return grounds


def _seen_from(fields: StaticFields, part: BoolGrid) -> BoolGrid:
    """Find the patrolled points in a part of the reachable ground, and those whose nearest seeing point lies in it."""
    hidden = fields.proxy >= 0
    seen_from_part = part & fields.patrolled
    seen_from_part[hidden] = part.reshape(-1)[fields.proxy[hidden]]
    return frozen_grid(seen_from_part)


FOUND = Path(__file__).parent.parent / "tours" / "found"
"""The folder of the tours that come with the code."""

VERSION = 2
"""Version of the search: a change of `patrol.tours` that gives other tours or rounds adds 1."""

NO_BOUND = "discs of the sensor's range around the robots have a larger area than the ground"
"""Why the lower bound of MFoW (`worldsim.output.record.lower_bound`) is 0 where it is."""

_known: dict[str, Tour | None] = {}
"""Tours by digest, of this process, the latest ones."""

LONG_STEP = 0.1
"""Length of a step, as a share of the sensor's range, from which on looks aside cost too many whole steps."""

SHARES = (1.0, 0.7, 0.5)
"""Shares of the range of a sensor that does not look all around, for whose discs tours are searched for."""

NARROWEST = 40.0
"""Angle of the narrowest sector with tours, degrees: looks in 16 headings miss some with a narrower one."""

MOST_KNOWN = 64
"""Tours that a process keeps in memory: a sweep over many buildings may need one each."""


@dataclass(frozen=True, slots=True)
class PartTour:
    """The tour of the robots of one radius in one part of the terrain."""

    speeds: Mapping[int, float]  # of the robots, by number, m/s
    length_m: float | None  # None where the ground is too large for a tour
    way: tuple[tuple[float, float], ...] = ()  # corners in order, x and y in m; empty without a tour


@dataclass(frozen=True, slots=True)
class BestTour:
    """The tours of a fleet, one for each part of the terrain.

    There are none where the sensor leaves some of a point's age, or is a class of an installed package, and for cars
    whose sensor does not look all around. Turns to look aside count as the way that wheels drive meanwhile.
    """

    parts: tuple[PartTour, ...]

    @property
    def length_m(self) -> float | None:
        """The length of all tours together, m; None without them."""
        lengths = [part.length_m for part in self.parts]
        return None if not lengths or None in lengths else sum(length for length in lengths if length is not None)

    def bound_s(self, shares: Mapping[int, float]) -> float | None:
        """Return the MFoW that robots keep by following the tours, each at its speed, s.

        Robots of one speed keep equal distances. Where speeds differ, it is as if each had a stretch of the tour in
        proportion to its speed. `shares` says by robot number for how much of the time it takes part, 0 to 1; robots
        that are missing do not. None where a part has no tour, or no robot.
        """
        bounds = []
        for part in self.parts:
            together = sum(speed * shares.get(number, 0.0) for number, speed in part.speeds.items())
            if part.length_m is None or together <= 0.0:
                return None
            bounds.append(part.length_m / together)
        return max(bounds, default=None)

    def bound_of_fleet_s(self, scenario: Scenario) -> float | None:
        """Return `bound_s` of all robots that are not spare, as if none were ever down."""
        return self.bound_s({spec.number: 1.0 for spec in scenario.roster if not spec.spare})


def best_tour(prepared: Prepared, ground: BoolGrid | None = None) -> BestTour:
    """Find the tours of a fleet over all ground or some of it, or take them from the cache.

    In a fleet of several radii, the larger bodies see what they can, and the smaller ones the rest.
    """
    finder = TourFinder(prepared)
    if not finder.has_tours:
        return BestTour(())
    groups: dict[int, list[int]] = {}
    for number, own in finder.grounds.items():
        groups.setdefault(id(own), []).append(number)
    specs = {spec.number: spec for spec in prepared.scenario.roster}
    uncovered = prepared.patrolled.copy() if ground is None else prepared.patrolled & ground
    parts = []
    for robots in sorted(groups.values(), key=lambda robots: -specs[robots[0]].radius):
        own = finder.grounds[robots[0]]
        part_ground = own.patrolled & uncovered
        uncovered &= ~own.patrolled
        if part_ground.any():
            tour = finder.find(own, part_ground, {specs[number].model for number in robots})
            speeds = {number: specs[number].speed for number in robots}
            length_m, way = (None, ()) if tour is None else (tour.cost_m(specs[robots[0]].radius), tour.way)
            parts.append(PartTour(speeds, length_m, way))
    return BestTour(tuple(parts))


def rounds_of(prepared: Prepared) -> dict[int, Round | None]:
    """Find each robot's round, by number: a short closed tour on which it sees all of its own ground, laid out.

    None in a fleet that follows none (`TourFinder.why_no_rounds`), where the ground is too large for a tour, and where
    all of it is seen from one place. Robots of one radius in one part of the terrain share one; where the sensor does
    not look all around, those of one model that see as much on it (`TourFinder.sees_less`).
    """
    finder = TourFinder(prepared)
    if finder.why_no_rounds:
        return dict.fromkeys(prepared.scenario.numbers)
    specs = {spec.number: spec for spec in prepared.scenario.roster}
    kinds = {
        number: (id(own), finder.sees_all_round or specs[number].model, finder.sees_less(specs[number]))
        for number, own in finder.grounds.items()
    }
    first = {kind: number for number, kind in reversed(kinds.items())}
    rounds = {kind: finder.find_round(finder.grounds[number], specs[number]) for kind, number in first.items()}
    return {number: rounds[kind] for number, kind in kinds.items()}


class TourFinder:
    """Finds tours for a fleet.

    There are tours only where the sensor leaves no age, and its code cannot change under its name. A robot whose sensor
    does not look all around follows a tour for a disc of a shorter range, and looks aside.
    """

    def __init__(self, prepared: Prepared) -> None:
        self._prepared, self.terrain = prepared, prepared.terrain
        self._footprint = footprint = sensor_footprint(prepared.scenario, prepared.terrain)
        identity = _sensor_identity(prepared.scenario.sensor)
        self.sees_all_round = footprint.all_round
        is_wide = footprint.all_round or prepared.scenario.sensor.angle >= NARROWEST
        self.has_tours = not footprint.leaves_age and identity is not None and is_wide
        self._identity = identity or ()

    @cached_property
    def grounds(self) -> dict[int, OwnGround]:
        """The own ground of each robot, by number; found only where it is asked for, as it takes long on large maps."""
        return own_grounds(self._prepared)

    @property
    def why_no_rounds(self) -> str:
        """The reason that robots with such a sensor have no rounds; empty where they may have."""
        if not self.has_tours:
            return (
                f"its sensor leaves some of a point's age, sees less than {NARROWEST:g} degrees, or is a class of an "
                "installed package"
            )
        if not self.sees_all_round and all(spec.model == "car" for spec in self._prepared.scenario.roster):
            return "its sensor does not look all around, and a car cannot turn on the spot"
        return ""

    def find(self, own: OwnGround, ground: BoolGrid, models: Collection[str]) -> Tour | None:
        """Find a tour over a part of some robots' own ground, with looks aside where their sensor needs them.

        None where the part is too large for a tour, and for cars that would have to look aside. A holonomic robot looks
        aside while it drives, so its tour is that of a sensor that sees all round.
        """
        if self.sees_all_round or set(models) == {"holonomic"}:
            return self._find(own, ground, 1.0, looks=False)
        if "car" in models:
            return None
        radius = next(s.radius for s in self._prepared.scenario.roster if self.grounds[s.number] is own)
        tours = [self._find(own, ground, share, looks=True) for share in SHARES]
        return min((tour for tour in tours if tour is not None), key=lambda tour: tour.cost_m(radius), default=None)

    def _find(self, own: OwnGround, ground: BoolGrid, share: float, *, looks: bool) -> Tour | None:
        """Find a tour known to this process, in the cache, or by a search, for a disc of a share of the range."""
        digest = self._digest(own, ground, *((share, looks) if share < 1.0 or looks else ()))

        def find() -> Tour | None:
            file = _tour_file(f"{digest}.json")
            try:
                return _read_tour(file, self.terrain, own)
            except (OSError, ValueError, LookupError, TypeError, OverflowError, AttributeError):
                from patrol.tours.looks import with_looks  # here: most processes need no tour
                from patrol.tours.search import find_tour

                tour = find_tour(self.terrain, own.reach, ground, own.proxy, self._narrow(share))
                if looks and tour is not None:
                    tour = with_looks(tour, self.terrain, own.reach, ground, self._footprint)
                if tour is not None:
                    _keep_tour(file, tour)
                return tour

        return latest(_known, digest, find, MOST_KNOWN)

    def find_round(self, own: OwnGround, spec: RobotSpec) -> Round | None:
        """Find the round over all of a robot's own ground; None where all is seen from one place, or without a tour."""
        if not own.patrolled.any():
            return None
        sees_less = self.sees_less(spec)
        if sees_less:
            tour, footprint = self._find(own, own.patrolled, SHARES[-1], looks=False), self._narrow(SHARES[-1])
        else:
            tour, footprint = self.find(own, own.patrolled, {spec.model}), self._footprint
        if tour is None or tour.length_m == 0.0:
            return None
        more = (SHARES[-1],) if sees_less else ()
        laid = f"Tour(length_m={tour.length_m!r}, way={tour.way!r})", *((tour.looks,) if tour.looks else ())
        file = _tour_file(f"{self._digest(own, own.patrolled, *laid, *more)}.npz")
        return lay_out(self.terrain, own.reach, own.patrolled, own.proxy, footprint, tour, file)

    def sees_less(self, spec: RobotSpec) -> bool:
        """Return True if a robot follows the round of a sensor that sees all round, but less far.

        One that looks aside as it likes, or turns on the spot in long steps, would otherwise have to look back at once
        for what goes out of view.
        """
        scenario = self._prepared.scenario
        has_long_steps = spec.model == "differential" and spec.speed * scenario.step > LONG_STEP * scenario.sensor.range
        return not self.sees_all_round and (spec.model == "holonomic" or has_long_steps)

    def _narrow(self, share: float) -> Footprint:
        """Return the footprint of a disc of a share of the sensor's range; the sensor's own where it sees all round."""
        if self.sees_all_round:
            return self._footprint
        from patrol.ground.sensors import footprint_of  # here: its kernels take time to load

        sensor = self._prepared.scenario.sensor
        return footprint_of(self.terrain, share * sensor.range, line_of_sight=sensor.line_of_sight)

    def _digest(self, own: OwnGround, ground: BoolGrid, *more: object) -> str:
        terrain, footprint = self.terrain, self._footprint
        # Corners are in m; left out where the origin is (0, 0), as it was at first, so that older files stay known.
        origin = terrain.origin if any(terrain.origin) else ()
        aside = () if self.sees_all_round else (self._prepared.scenario.sensor.angle,)
        sensor = footprint.radius, footprint.line_of_sight, *self._identity, *aside
        digest = hashlib.sha256(repr((VERSION, terrain.shape, terrain.point, *sensor, *more, *origin)).encode())
        for grid in (terrain.passable, own.reach, ground):
            digest.update(np.packbits(grid).tobytes())
        return digest.hexdigest()[:32]


def _read_tour(file: Path, terrain: Terrain, own: OwnGround) -> Tour:
    """Read a tour from the cache; raise ValueError or what reading raises where it holds none of this ground."""
    says = json.loads(file.read_text(encoding="utf-8"))
    length_m, corners = float(says["length_m"]), says["way"]
    way, looks = (tuple((float(x), float(y)) for x, y in pairs) for pairs in (corners, says.get("looks", ())))
    tour = Tour(length_m, way, looks, float(says.get("turned", 0.0)))
    numbers = [tour.length_m, tour.turned, *(number for look in tour.looks for number in look)]
    if not all(map(math.isfinite, numbers)) or tour.length_m < 0.0 or tour.turned < 0.0 or not tour.way:
        raise ValueError("no tour")
    looks_m = [0.0, *(at_m for at_m, _ in tour.looks), tour.length_m]
    if looks_m != sorted(looks_m):
        raise ValueError("looks that are not on the tour")
    if not all(terrain.contains(*corner) and own.reach[terrain.point_at(*corner)] for corner in tour.way):
        raise ValueError("a tour of other ground")
    return tour


def _keep_tour(file: Path, tour: Tour) -> None:
    """Write a tour into the cache, if it can be written."""
    with suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        aside = {} if not tour.looks else {"looks": tour.looks, "turned": tour.turned}
        write_whole(file, json.dumps({"length_m": tour.length_m, "way": tour.way, **aside}))


def _tour_file(name: str) -> Path:
    """Return the file of a tour: one that comes with the code, or that in the user's cache, which may not be there."""
    return known if (known := FOUND / name).is_file() else (user_cache("tours") or Path(os.devnull)) / name


def _sensor_identity(sensor: SensorSpec) -> tuple[str, ...] | None:
    """Tell a sensor of one's own from others of its range; return None if its code may change under its name."""
    if sensor.kind in BUILT_IN_SENSORS:
        return ()
    if sensor.kind_sha256 is None:
        return None
    return sensor.kind_sha256, sensor.kind.rpartition(":")[2], json.dumps(sensor.options, sort_keys=True)
