"""The zones of a scenario as weights of the ground.

- A point's weight is the greatest of the zones that it lies in, and 1 where it lies in none.
- A wanted age of S seconds is a weight of T / S. T is the MFoW of the fleet on the best tour found over all of the
  ground, as if there were no weights. For example, where that keeps 120 s, a wish for 60 s is a weight of 2.
- Zones may begin and end, and their weights change, so there are weights for each set of zones and weights that are in
  force together.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from patrol.errors import BadInput
from patrol.exchange import LEAST_WEIGHT, MOST_WEIGHT
from patrol.measures.best_tour import best_tour, rounds_of
from patrol.zones.spec import Weighing, points_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from patrol.prepare import Prepared


Weights = NDArray[np.float64]
"""How many times the age of each point counts, (height, width), read-only."""

MOST_KEPT = 8
"""Sets of zones whose weights are kept: those that were asked for last."""

MOST_TOURS = 4
"""Distinct weights of ground over which tours are found: each may take a search."""


def with_rounds(prepared: Prepared, needed: bool = True) -> Prepared:
    """Find the weights of zones, and rounds where they are `needed`, unless they were found before.

    Raises BadInput as `zone_weights` does.
    """
    rounds = rounds_of(prepared) if needed and not prepared.rounds else prepared.rounds
    return replace(prepared, rounds=rounds, zone_weights=zone_weights(prepared))


def zone_weights(prepared: Prepared) -> Mapping[str, float]:
    """Return the weight of each zone that has one, by name, as at first.

    Raises BadInput where there is a wanted age, and no tour that says how it compares with the other ground.
    """
    if prepared.zone_weights:
        return prepared.zone_weights
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


class ZonedGround:
    """The weights of a terrain's points under each set of zones in force."""

    def __init__(self, prepared: Prepared) -> None:
        """Take the zones that weigh."""
        self._prepared = prepared
        self._zones = [zone for zone in prepared.scenario.zones if zone.weighs]
        self._weigh = lru_cache(maxsize=MOST_KEPT)(self._lay_out)

    def under(self, weighing: Weighing, margin: float = 1.0) -> Weights | None:
        """Return the weights while some zones are in force; None where no zone ever weighs.

        Those of wanted ages are multiplied by a margin. Raises BadInput as `zone_weights` does, where the ground is not
        `with_rounds`.
        """
        return self._weigh(weighing, margin) if self._zones else None

    def _lay_out(self, weighing: Weighing, margin: float) -> Weights:
        prepared, weight_of = self._prepared, dict(weighing)
        first = zone_weights(prepared)
        weights: Weights = np.zeros(prepared.terrain.shape)
        for zone in self._zones:
            if zone.name in weight_of:
                points, weight = points_of(zone, prepared.terrain), weight_of[zone.name]
                weight = first[zone.name] * margin if weight is None else weight
                weights[points] = np.maximum(weights[points], weight)
        weights[weights == 0.0] = 1.0
        weights.flags.writeable = False
        return weights


def best_weighted_s(prepared: Prepared, weights: Weights) -> float | None:
    """Return the weighted MFoW that all robots that are not spare keep on the best tours, on the worst ground, s.

    As if they were all on the tour over the ground of at least each weight. For example, three robots at 1 m/s, 300 m
    over all ground, and 60 m over that of weight 10: 10 times 20 s is more than 100 s. None without tours, or with more
    than `MOST_TOURS` weights.
    """
    distinct = np.unique(weights[prepared.patrolled]).tolist()
    if len(distinct) > MOST_TOURS:
        return None
    tours = {weight: best_tour(prepared, weights >= weight) for weight in distinct}
    bounds = {weight: tour.bound_of_fleet_s(prepared.scenario) for weight, tour in tours.items()}
    known = [weight * bound for weight, bound in bounds.items() if bound is not None]
    return max(known) if len(known) == len(bounds) else None
