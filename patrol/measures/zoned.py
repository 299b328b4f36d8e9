"""The zones of a scenario as weights of the ground, and the rounds of its fleet over them.

- A point's weight is the greatest of the zones that it lies in, and 1 where it lies in none.
- A wanted age of S seconds is a weight of T / S. T is the MFoW of the fleet on the best tour found over all of the
  ground, as if there were no weights. For example, where that keeps 120 s, a wish for 60 s is a weight of 2.
- Zones may begin and end, and their weights change, so there is a zoned ground for each set of zones and weights that
  are in force together.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import combinations, combinations_with_replacement
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.errors import BadInput
from patrol.exchange import LEAST_WEIGHT, MOST_WEIGHT
from patrol.ground.ways import lengths_along
from patrol.measures.best_tour import TourFinder, best_tour, rounds_of
from patrol.zones.division import MOST_CLASSES, Classes, Divisions, ZonedGround
from patrol.zones.spec import Weighing, points_of, weighing_at

if TYPE_CHECKING:
    from patrol.ground.terrain import BoolGrid, Terrain
    from patrol.prepare import Prepared
    from patrol.scenario import Scenario
    from patrol.tours.round import Round, Tour


MOST_COMBINED = 3
"""Zones with weights or wanted ages of which every combination is prepared for."""

MOST_PREPARED = 32
"""Sets of zones that are prepared for, at most; the others are when they come into force."""

MOST_LATER = 8
"""Sets of zones whose ground is kept besides as many as may be prepared: those that came into force last. One that is
dropped and comes into force again is found again, with the same result."""


def with_rounds(prepared: Prepared, needed: bool = True, *, switched: bool = False) -> Prepared:
    """Find what robots follow, unless it was found before: rounds where they are `needed`, and the ground of zones.

    On ground with zones that weigh, `zoned` then holds the sets of zones that come into force by their times, and where
    zones may be `switched` by operators, what they can make of them: all combinations of few zones, or those in which
    one zone is switched. So no robot has to find these during a run. Raises BadInput as `ZonedGrounds` does.
    """
    scenario = prepared.scenario
    if not any(zone.weighs for zone in scenario.zones):
        return replace(prepared, rounds=rounds_of(prepared)) if needed and not prepared.rounds else prepared
    if prepared.zoned:
        return prepared
    grounds, sets = ZonedGrounds(prepared), _timed_sets(scenario)
    if switched:
        sets += _switched_sets(scenario, sets)
    zoned = {}
    for weighing in list(dict.fromkeys(sets))[:MOST_PREPARED]:
        divisions = grounds.under(weighing)
        assert divisions is not None
        zoned[weighing] = divisions.zoned
    return replace(prepared, zoned=zoned)


def _timed_sets(scenario: Scenario) -> list[Weighing]:
    """Return the sets of zones that come into force by their times."""
    turns = {time_s for zone in scenario.zones for span in zone.times or () for time_s in span}
    turns |= {start_s for zone in scenario.zones for start_s, _ in zone.weights or ()}
    ticks = {0, *(math.ceil(time_s / scenario.step) for time_s in turns)}
    return [weighing_at(scenario.zones, k * scenario.step) for k in sorted(ticks) if k < scenario.ticks]


def _switched_sets(scenario: Scenario, timed: list[Weighing]) -> list[Weighing]:
    """Return what operators can make of the sets of zones that come into force by their times."""
    by_name = sorted(((zone.name, zone.weight) for zone in scenario.zones if zone.weighs), key=itemgetter(0))
    if len(by_name) <= MOST_COMBINED:
        return [frozenset(some) for size in range(len(by_name) + 1) for some in combinations(by_name, size)]
    return [_with_switched(weighing, *zone) for weighing in timed for zone in by_name]


def _with_switched(weighing: Weighing, name: str, weight: float | None) -> Weighing:
    """Return the zones in force once one of them is switched off, or another one on with a weight."""
    remaining = frozenset(zone for zone in weighing if zone[0] != name)
    return remaining if len(remaining) < len(weighing) else remaining | {(name, weight)}


class ZonedGrounds:
    """The ground of a fleet under each set of zones in force: as prepared, or found when they come into force.

    The minds of one process share one, and a verdict has its own. It raises BadInput where there is a wanted age, and
    no tour that says how it compares with the other ground.
    """

    def __init__(self, prepared: Prepared) -> None:
        """Begin with what was prepared."""
        self._prepared = prepared
        self._weigh = any(zone.weighs for zone in prepared.scenario.zones)
        self._known: dict[Weighing, Divisions] = {}
        for weighing, zoned in prepared.zoned.items():
            self._add(weighing, zoned)

    def under(self, weighing: Weighing) -> Divisions | None:
        """Return the ground while some zones are in force, and its divisions; None where no zone ever weighs."""
        if not self._weigh:
            return None
        divisions = self._known.get(weighing)
        if divisions is None:
            earlier = [known.zoned for known in list(self._known.values())]
            divisions = self._add(weighing, _find_zoned(self._prepared, weighing, earlier))
            for oldest in list(self._known)[MOST_PREPARED:-MOST_LATER]:  # copied, as minds may ask in several threads
                self._known.pop(oldest, None)
        return divisions

    def _add(self, weighing: Weighing, zoned: ZonedGround) -> Divisions:
        """Add ground; with the same rounds and wishes as other ground, its groups keep the same ages."""
        alike = (
            known.group_ages
            for known in list(self._known.values())
            if known.zoned.rounds is zoned.rounds and known.zoned.wanted == zoned.wanted
        )
        self._known[weighing] = divisions = Divisions(zoned, next(alike, None))
        return divisions


def zone_weights(prepared: Prepared) -> dict[str, float]:
    """Return the weight of each zone that has one, by name, as at first; raise BadInput as `ZonedGrounds` does."""
    weights, tour_s = {}, None
    for number, zone in enumerate(prepared.scenario.zones):
        if zone.weight is not None:
            weights[zone.name] = zone.weight
        elif zone.age is not None:
            tour_s = tour_s or best_tour(prepared).bound_of_fleet_s(prepared.scenario)
            if not tour_s:
                raise BadInput(
                    f"zones.{number}.age = {zone.age:g}: there is no tour of this ground with this sensor to compare "
                    f"{zone.name} with; give it a weight"
                )
            weights[zone.name] = round(min(max(tour_s / zone.age, LEAST_WEIGHT), MOST_WEIGHT), 3)
    return weights


def _find_zoned(prepared: Prepared, weighing: Weighing, earlier: Iterable[ZonedGround]) -> ZonedGround:
    """Weigh the ground, and find the rounds over it; `earlier` ground may have them already."""
    terrain, patrolled, scenario = prepared.terrain, prepared.patrolled, prepared.scenario
    grid: NDArray[np.float64] = np.zeros(terrain.shape)
    weight_of = dict(weighing)
    by_name = zone_weights(prepared) | {name: weight for name, weight in weight_of.items() if weight is not None}
    wanted: dict[float, float] = {}
    zones = [zone for zone in scenario.zones if zone.name in weight_of]
    for zone in zones:
        points = points_of(zone, terrain)
        grid[points] = np.maximum(grid[points], by_name[zone.name])
    grid[grid == 0.0] = 1.0
    grid.flags.writeable = False
    for zone in zones:
        if zone.age is not None:
            weight = float(grid[points_of(zone, terrain) & patrolled].min())  # other zones may weigh parts of it more
            wanted[weight] = min(zone.age, wanted.get(weight, zone.age))
    classes = tuple(np.unique(grid[patrolled]).tolist())
    finder, order = TourFinder(prepared), np.searchsorted(classes, grid[patrolled])
    # The same points in each class have the same rounds.
    alike = (
        known.rounds
        for known in earlier
        if known.rounds and np.array_equal(np.searchsorted(known.classes, known.weights[patrolled]), order)
    )
    rounds = next(alike, None) or _find_rounds(finder, grid, classes)
    speed = min(spec.speed for spec in scenario.roster)
    wishes = tuple(wanted.get(weight) for weight in classes)
    visited = [number for number, wish in enumerate(wishes) if wish is not None and rounds]
    reach = next(iter(finder.grounds.values())).reach
    ways = {number: _ways_m(terrain, reach, rounds[number, number]) for number in visited}
    return ZonedGround(grid, classes, wishes, rounds, speed, ways)


def _ways_m(terrain: Terrain, reach: BoolGrid, laid_out: Round) -> NDArray[np.float32]:
    """Return the length of the way from each point to the nearest place of a round, float32 (height, width), m."""
    from patrol.kernels.ways import FAR  # here: few processes need it

    starts = [divmod(cell, terrain.width) for cell in laid_out.places.tolist()]
    lengths = lengths_along(reach, starts, FAR)[1:-1, 1:-1]
    return np.where(lengths < FAR, lengths * np.float32(terrain.point / 100.0), np.float32(np.inf))


def _find_rounds(finder: TourFinder, grid: NDArray[np.float64], classes: tuple[float, ...]) -> Mapping[Classes, Round]:
    """Find the rounds of all groups; none where the fleet follows no rounds, or has several grounds or many classes."""
    own = next(iter(finder.grounds.values()))
    if finder.why_not_divided or len(set(map(id, finder.grounds.values()))) > 1 or len(classes) > MOST_CLASSES:
        return {}
    tours: dict[Classes, Tour] = {}
    grounds: dict[Classes, BoolGrid] = {}
    for group in combinations_with_replacement(range(len(classes)), 2):
        ground = own.patrolled & (grid >= classes[group[0]]) & (grid <= classes[group[1]])
        tour = finder.find(own, ground) if ground.any() else None
        if tour is None:
            return {}
        grounds[group], tours[group] = ground, tour
    rounds = {}
    for first, last in tours:
        # The search may find a shorter tour for more ground, and that will do for less.
        wider = (tour for (low, high), tour in tours.items() if low <= first and last <= high)
        laid_out = finder.lay_out(own, grounds[first, last], min(wider, key=lambda tour: tour.length_m))
        # At least a point long: all of the ground may be seen from one place.
        rounds[first, last] = replace(laid_out, length_m=max(laid_out.length_m, finder.terrain.point))
    return rounds
