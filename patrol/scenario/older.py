"""The section `patrol` of files of 1.0, as this version has it.

Up to 1.0, `committed` was the default and mixed two patrols: its setting `unpredictability` was the share of the time
in which robots followed no tour, and chose freely with random steps. Now `committed` is the tour alone, and means the
same where that share was 0. Any other share stands for `stochastic`.

    {policy: committed, options: {unpredictability: 0.5, random_move: 0.1}}     1.0
    {policy: stochastic}                                                        this version
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from patrol.scenario.policies import COMMITTED, DEFAULT, STOCHASTIC, TOUR_STATED

_SHARE = "unpredictability"
"""Setting of `committed`: the share of the time of free choices."""

_RANDOM_STEPS: Mapping[str, Any] = MappingProxyType(
    {name: value for name, value in TOUR_STATED.items() if name != _SHARE}
)
"""Settings of free choices that are settings no longer, and the values that they keep."""

_SEE = "docs/compatibility.md"


def translate_patrol(patrol: Mapping[str, Any], notes: list[str]) -> dict[str, Any]:
    """Translate a section of 1.0; leave one of this version as it is.

    The section is unchecked, as a file or an override has it. `notes` takes one line for each setting whose meaning
    changes.
    """
    section = {name: value for name, value in patrol.items() if name != "options" or value is not None}
    options, policy = section.get("options"), section.get("policy", DEFAULT)
    # 1.0 has not stated `stochastic`, so what such a section has is refused where it is no setting.
    if isinstance(options, Mapping) and (policy == COMMITTED or "policy" not in section):
        now, section["options"] = _without_free_choices(policy, options, notes)
        if now != policy:
            section["policy"] = now
    return section


def _without_free_choices(policy: str, options: Mapping[str, Any], notes: list[str]) -> tuple[str, dict[str, Any]]:
    """Return policy and settings of this version for settings of `committed` and `stochastic`; notes: see above."""
    remaining = {name: value for name, value in options.items() if name not in _RANDOM_STEPS}
    if policy == COMMITTED:
        share = options.get(_SHARE, 0.0)
        if isinstance(share, int | float) and 0.0 <= share <= 1.0:
            remaining.pop(_SHARE, None)
            if share > 0.0:
                notes.append(f"patrol.policy: committed with {_SHARE} {share:g} is {STOCHASTIC} now; see {_SEE}")
                return STOCHASTIC, remaining
    for name, value in _RANDOM_STEPS.items():
        if options.get(name, value) != value:
            notes.append(f"patrol.options.{name} = {options[name]}: left out, as {policy} has it no more; see {_SEE}")
    return policy, remaining
