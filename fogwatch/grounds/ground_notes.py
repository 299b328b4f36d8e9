"""Notes on a scenario's ground that everyone must read before they believe what is computed on it."""

from __future__ import annotations

from patrol.ground.maps.doubts import doubts
from patrol.prepare import Prepared


def ground_notes(prepared: Prepared) -> list[str]:
    """Describe what is doubtful about the reading of the map, and the free ground that no robot sees.

    Args:
        prepared: The scenario, its terrain and the bodies' static fields.

    Returns:
        One line each.
    """
    left_out = prepared.left_out
    return [*doubts(prepared.terrain), *([] if left_out is None else [f"left out: {left_out.text}"])]
