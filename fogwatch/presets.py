"""Presets: settings that belong together, so that nobody has to write them one by one."""

from __future__ import annotations

from collections.abc import Mapping

from patrol.errors import BadInput

PRESETS: Mapping[str, str] = {
    "paper": "the paper's algorithm, bodies and sensor, without our additions",
    "letter": "the same, and each rule of the algorithm to the letter",
}
"""The presets by name, and what each is."""

POINT_M = 0.5
"""Side of a point with which the paper's tables are reproduced, and for which the sensor's range was calibrated, m."""


def preset_settings(name: str | None) -> dict[str, object]:
    """Return the settings of a preset: those that all cells of the paper's tables share, for any terrain and team.

    Args:
        name: One of `PRESETS`, or None for no settings.

    Returns:
        Values by dotted field of the scenario.

    Raises:
        BadInput: There is no such preset.
    """
    if name is None:
        return {}
    if name not in PRESETS:
        raise BadInput(f"preset {name}: no such preset; choose from {', '.join(PRESETS)}")
    from experiments.paper.printed import paper
    from patrol.scenario.letter import TO_THE_LETTER

    settings = {**paper().settings, "point": POINT_M, "sensor.range": paper().sensor_range(POINT_M).range}
    return {**settings, **TO_THE_LETTER} if name == "letter" else settings
