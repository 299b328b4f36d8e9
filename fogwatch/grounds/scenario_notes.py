"""Notes on a scenario that everyone must read before they believe what is computed of it."""

from __future__ import annotations

from patrol.ground.maps.doubts import doubts
from patrol.prepare import Prepared


def scenario_notes(prepared: Prepared) -> list[str]:
    """Describe doubtful readings of the map, free ground that no robot sees, and settings of earlier versions.

    Args:
        prepared: The scenario, its terrain and the bodies' static fields.

    Returns:
        One line each.
    """
    left_out = prepared.left_out
    return [
        *doubts(prepared.terrain),
        *([] if left_out is None else [f"left out: {left_out.text}"]),
        *prepared.scenario.translated,
    ]
