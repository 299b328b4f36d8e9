"""Notes on a scenario that everyone must read before they believe what is computed of it."""

from __future__ import annotations

import math

from patrol.ground.maps.doubts import doubts
from patrol.measures.best_tour import most_planned, why_no_rounds
from patrol.prepare import Prepared
from patrol.scenario.patrols import FIELD, PATROLS, STOCHASTIC, TOUR
from patrol.scenario.policies import StochasticPatrol

MEASURED = "docs/results/intruders.md#where-nothing-is-drawn"


def scenario_notes(prepared: Prepared) -> list[str]:
    """Describe in a line each what is doubtful about a scenario.

    That is: doubtful readings of the map, free ground that no robot sees, a patrol without a plan, older settings.
    """
    left_out = prepared.left_out
    return [
        *doubts(prepared.terrain),
        *([] if left_out is None else [f"left out: {left_out.text}"]),
        *_not_drawn(prepared),
        *prepared.scenario.translated,
    ]


def _not_drawn(prepared: Prepared) -> list[str]:
    """Say that the patrols `stochastic` and `tour` have no plan, or that nothing is drawn from it, and why."""
    scenario = prepared.scenario
    policy = scenario.patrol.policy
    if policy not in (PATROLS[STOCHASTIC].policy, PATROLS[TOUR].policy):
        return []
    free = f"{FIELD} {policy}: each robot chooses its next place freely, without a plan"
    if why := why_no_rounds(prepared):
        return [f"{free}: {why}"]
    if not isinstance(scenario.patrol, StochasticPatrol):
        return []
    most = most_planned(float(prepared.patrolled.sum()) * scenario.point**2, scenario.sensor.range)
    if scenario.team > most and not scenario.zones:
        than = f"more than {math.floor(most)} share this ground" if most >= 1.0 else "the ground is so small"
        return [f"{free}, while {than} (docs/algorithm.md#drawn-stations)"]
    if scenario.patrol.options.unpredictability == 0.0:
        return [f"patrol.options.unpredictability = 0: the best plan is followed, and nothing is drawn ({MEASURED})"]
    return []
