"""The ways in which Python code names a scenario."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from patrol.scenario import Scenario, as_mapping, load_scenario, open_scenario


def scenario_of(
    scenario: Scenario | Mapping[str, Any] | str | Path, overrides: Mapping[str, object] | None = None
) -> Scenario:
    """Load a scenario, with overrides by dotted field.

    It may be a scenario file, a map's YAML file, the name of a built-in terrain, a mapping shaped like a scenario file,
    or a loaded scenario.
    """
    if isinstance(scenario, Scenario):
        return load_scenario(as_mapping(scenario), overrides)
    if isinstance(scenario, Mapping):
        return load_scenario(scenario, overrides)
    return open_scenario(str(scenario), overrides)
