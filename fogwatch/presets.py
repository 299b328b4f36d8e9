"""Presets: settings that belong together, under one name."""

from __future__ import annotations

from collections.abc import Mapping

from patrol.errors import BadInput
from patrol.extras import study
from patrol.scenario.patrols import patrol_settings

POINT_M = 0.5
"""Side of a point with which the paper's tables are reproduced, and for which the sensor's range was calibrated, m."""

_POINTS = f"on points of {POINT_M:g} m (the paper's: 0.1 m)"

PRESETS: Mapping[str, str] = {
    "paper": f"the paper's algorithm, bodies and sensor, with rules of ours where it is open or fails, {_POINTS}",
    "letter": f"the paper without our additions, each rule as printed, random steps for cars too, {_POINTS}",
}
"""The presets by name, and what each is."""


def preset_settings(name: str | None) -> dict[str, object]:
    """Return the settings of a preset, by dotted field of the scenario; None has no settings.

    They are those that all cells of the paper's tables share, for any terrain and team.
    """
    if name is None:
        return {}
    if name not in PRESETS:
        raise BadInput(f"preset {name}: no such preset; choose from {', '.join(PRESETS)}")
    from patrol.scenario.policies import TO_THE_LETTER

    paper = study("paper.printed").paper

    settings = {**paper().settings, "point": POINT_M, "sensor.range": paper().sensor_range(POINT_M).range}
    return {**settings, **TO_THE_LETTER} if name == "letter" else settings


def chosen_settings(overrides: Mapping[str, object], patrol: str | None, preset: str | None) -> dict[str, object]:
    """Return overrides, by dotted field, with the settings of a preset, over which they hold, and of a named patrol."""
    settings = {**preset_settings(preset), **overrides}
    return settings | patrol_settings(patrol, settings)
