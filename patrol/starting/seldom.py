"""Kernels that few runs need: the rest of a scenario's are compiled before it runs, these only where it uses them.

A module that is missing here is compiled before every first run. One that is listed although a run needs it is compiled
when that run imports it, in one process while the others wait.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from patrol.scenario import Scenario


def _follows_forces(scenario: Scenario) -> bool:
    """Return True if robots sum forces, or may: a policy of another kind can build on anything."""
    from patrol.scenario.policies import LEARNED  # here, as processes that compile need no scenario

    return not scenario.patrol.needs_rounds and scenario.patrol.policy != LEARNED


def _needs_dilation(scenario: Scenario) -> bool:
    """Return True if beliefs spread staleness (`agent.belief.believed.BelievedFog`); an open field has no posts."""
    return _follows_forces(scenario) or scenario.terrain.builtin == "open"


def _is_learned(scenario: Scenario) -> bool:
    from patrol.scenario.policies import LEARNED

    return scenario.patrol.policy == LEARNED


def _has_regions(scenario: Scenario) -> bool:
    return scenario.patrol.paths == "regions"


def _goes_straight(scenario: Scenario) -> bool:
    return scenario.patrol.paths == "straight"


SELDOM: Mapping[str, Callable[[Scenario], bool]] = {
    "agent.kernels.changes": _needs_dilation,
    "agent.kernels.dilate": _needs_dilation,
    "agent.kernels.surroundings": _is_learned,
    "agent.kernels.force": _follows_forces,
    "agent.kernels.region_paths": _has_regions,
    "agent.kernels.straight": _goes_straight,
    "patrol.kernels.doors": lambda _: False,  # where a random start may be shut in
    "patrol.kernels.regions": _has_regions,
}
"""Modules, and whether a run of a scenario needs them."""


def seldom_kernels(scenario: Scenario) -> list[str]:
    """Return the modules of `SELDOM` that a run needs."""
    return [name for name, needs in SELDOM.items() if needs(scenario)]
