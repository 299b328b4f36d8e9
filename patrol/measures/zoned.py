"""The zones of a scenario as weights of the ground, and the rounds of its fleet over them.

- A point's weight is the greatest of the zones that it lies in, and 1 where it lies in none.
- A wanted age of S seconds is a weight of T / S. T is the MFoW of the fleet on the best tour found over all of the
  ground, as if there were no weights. For example, where that keeps 120 s, a wish for 60 s is a weight of 2.
- Zones may begin and end, and their weights change, so there is a zoned ground for each set of zones and weights that
  are in force together.
"""

from __future__ import annotations

import math
from itertools import combinations, combinations_with_replacement
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.errors import BadInput
from patrol.exchange import LEAST_WEIGHT, MOST_WEIGHT
from patrol.ground.ways import lengths_along
from patrol.measures.best_tour import best_tour, own_grounds, round_over, tour_over
from patrol.zones.division import MOST_CLASSES, Classes, ZonedGround
from patrol.zones.spec import Weighing, points_of, weighing_at

if TYPE_CHECKING:
    from patrol.ground.terrain import BoolGrid
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


def zoned_ground(prepared: Prepared, weighing: Weighing | None = None) -> ZonedGround | None:
    """Weigh the ground by the zones in force (default: all, as at first), and find the rounds over it.

    `Prepared.zoned` keeps the results. None where no zone ever has a weight or a wanted age. Raises BadInput where
    there is a wanted age, and no tour that says how it compares with the other ground.
    """
    every = _at_first(prepared.scenario)
    if not every:
        return None
    weighing = every if weighing is None else weighing
    cache = prepared.zoned
    ground = cache.get(weighing)
    if ground is None:
        ground = cache[weighing] = _zoned_ground(prepared, weighing)
        for oldest in list(cache)[MOST_PREPARED:-MOST_LATER]:  # copied, as minds may ask in several threads
            cache.pop(oldest, None)
    return ground


def prepare_zones(prepared: Prepared) -> None:
    """Find the rounds for the sets of zones that may come into force, so that no robot has to during a run.

    These are the sets by the zones' times, and what operators can make of them: all combinations of few zones, or those
    in which one zone is switched. Raises BadInput as `zoned_ground` does.
    """
    scenario, every = prepared.scenario, _at_first(prepared.scenario)
    turns = {time_s for zone in scenario.zones for span in zone.times or () for time_s in span}
    turns |= {start_s for zone in scenario.zones for start_s, _ in zone.weights or ()}
    ticks = {0, *(math.ceil(time_s / scenario.step) for time_s in turns)}
    sets = (weighing_at(scenario.zones, k * scenario.step) for k in sorted(ticks) if k < scenario.ticks)
    timed = list(dict.fromkeys(sets))
    by_name = sorted(every, key=itemgetter(0))
    if len(every) <= MOST_COMBINED:
        alternatives = [frozenset(some) for size in range(len(every) + 1) for some in combinations(by_name, size)]
    else:
        alternatives = [_with_switched(weighing, *zone) for weighing in timed for zone in by_name]
    for weighing in list(dict.fromkeys([*timed, *alternatives]))[:MOST_PREPARED]:
        zoned_ground(prepared, weighing)


def zone_weights(prepared: Prepared) -> dict[str, float]:
    """Return the weight of each zone that has one, by name, as at first; raise BadInput as `zoned_ground` does."""
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


def best_weighted_s(prepared: Prepared, weighing: Weighing | None = None) -> float | None:
    """Return the weighted MFoW (s) of all robots but the spare ones on the rounds of the best division.

    None without zones or rounds. It leaves out that slow zones take longer. The zones in force are as for
    `zoned_ground`.
    """
    zoned = zoned_ground(prepared, weighing)
    groups = () if zoned is None else zoned.divide(prepared.scenario.team)
    return None if zoned is None or not groups else zoned.cost_s(groups)


def _at_first(scenario: Scenario) -> Weighing:
    """Return all zones that weigh, as if all were in force with their first weights."""
    return frozenset((zone.name, zone.weight) for zone in scenario.zones if zone.weighs)


def _with_switched(weighing: Weighing, name: str, weight: float | None) -> Weighing:
    """Return the zones in force once one of them is switched off, or another one on with a weight."""
    remaining = frozenset(zone for zone in weighing if zone[0] != name)
    return remaining if len(remaining) < len(weighing) else remaining | {(name, weight)}


def _zoned_ground(prepared: Prepared, weighing: Weighing) -> ZonedGround:
    terrain, patrolled = prepared.terrain, prepared.patrolled
    grid: NDArray[np.float64] = np.zeros(terrain.shape)
    weight_of = dict(weighing)
    by_name = zone_weights(prepared) | {name: weight for name, weight in weight_of.items() if weight is not None}
    wanted: dict[float, float] = {}
    zones = [zone for zone in prepared.scenario.zones if zone.name in weight_of]
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
    earlier = _known_ground(prepared, grid, classes)
    rounds = _find_rounds(prepared, grid, classes) if earlier is None else earlier.rounds
    speed = min(spec.speed for spec in prepared.scenario.roster)
    wishes = tuple(wanted.get(weight) for weight in classes)
    laid_out = earlier.laid_out if earlier is not None and earlier.wanted == wishes else {}
    visited = [number for number, wish in enumerate(wishes) if wish is not None and rounds]
    ways = {number: _ways_m(prepared, rounds[number, number]) for number in visited}
    return ZonedGround(grid, classes, wishes, rounds, speed, ways, laid_out)


def _ways_m(prepared: Prepared, laid_out: Round) -> NDArray[np.float32]:
    """Return the length of the way from each point to the nearest place of a round, float32 (height, width), m."""
    from patrol.kernels.ways import FAR  # here: few processes need it

    terrain, ground = prepared.terrain, next(iter(own_grounds(prepared).values()))
    starts = [divmod(cell, terrain.width) for cell in laid_out.places.tolist()]
    lengths = lengths_along(ground.reach, starts, FAR)[1:-1, 1:-1]
    return np.where(lengths < FAR, lengths * np.float32(terrain.point / 100.0), np.float32(np.inf))


def _known_ground(prepared: Prepared, grid: NDArray[np.float64], classes: tuple[float, ...]) -> ZonedGround | None:
    """Return prepared ground with the same points in each class, so with the same rounds; None without such ground."""
    order = np.searchsorted(classes, grid[prepared.patrolled])
    for earlier in list(prepared.zoned.values()):
        if earlier.rounds and np.array_equal(
            np.searchsorted(earlier.classes, earlier.weights[prepared.patrolled]), order
        ):
            return earlier
    return None


def _find_rounds(prepared: Prepared, grid: NDArray[np.float64], classes: tuple[float, ...]) -> dict[Classes, Round]:
    """Find the rounds of all groups; none where the fleet follows no rounds, or has several grounds or many classes."""
    grounds = list({id(robot_ground): robot_ground for robot_ground in own_grounds(prepared).values()}.values())
    if len(grounds) > 1 or len(classes) > MOST_CLASSES:
        return {}
    count = len(classes)
    tours: dict[Classes, Tour] = {}
    grounds_of: dict[Classes, BoolGrid] = {}
    for group in combinations_with_replacement(range(count), 2):
        ground = grounds[0].patrolled & (grid >= classes[group[0]]) & (grid <= classes[group[1]])
        tour = tour_over(prepared, ground) if ground.any() else None
        if tour is None:
            return {}
        grounds_of[group], tours[group] = ground, tour
    # The search may find a shorter tour for more ground, and that will do for less.
    shortest = {
        (first, last): min(
            (tour for (low, high), tour in tours.items() if low <= first and last <= high),
            key=lambda tour: tour.length_m,
        )
        for first, last in tours
    }
    return {group: round_over(prepared, grounds_of[group], shortest[group]) for group in tours}
