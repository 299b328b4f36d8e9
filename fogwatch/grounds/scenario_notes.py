"""Notes on a scenario that everyone must read before they believe what is computed of it."""

from __future__ import annotations

from patrol.ground.maps.doubts import doubts
from patrol.measures.best_tour import why_no_rounds
from patrol.prepare import Prepared
from patrol.scenario.patrols import FIELD, PATROLS, STOCHASTIC, TOUR


def scenario_notes(prepared: Prepared) -> list[str]:
    """Describe doubtful readings of the map, free ground that no robot sees, a patrol without a plan, older settings.

    Args:
        prepared: The scenario, its terrain and the bodies' static fields.

    Returns:
        One line each.
    """
    left_out = prepared.left_out
    return [
        *doubts(prepared.terrain),
        *([] if left_out is None else [f"left out: {left_out.text}"]),
        *_without_plan(prepared),
        *prepared.scenario.translated,
    ]


def _without_plan(prepared: Prepared) -> list[str]:
    """Say that the patrols `stochastic` and `tour` choose each next place freely, and why."""
    policy = prepared.scenario.patrol.policy
    if policy not in (PATROLS[STOCHASTIC].policy, PATROLS[TOUR].policy):
        return []
    why = why_no_rounds(prepared)
    return [f"{FIELD} {policy}: each robot chooses its next place freely, without a plan: {why}"] if why else []
