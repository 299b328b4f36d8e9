"""Sections `patrol` of earlier versions, as this version has them.

Up to 0.2, `potential-field` was the name of both built-in policies: `commitment` chose between them, and the settings
of both stood in the section `patrol` itself, those without effect too.

    {commitment: target, alpha: 40, dilatation: 5}     0.2
    {policy: stochastic}                               this version

Up to 1.0, `committed` was the default and mixed two patrols: its setting `unpredictability` was the share of the time
in which robots followed no tour, and chose freely with random steps. Now `committed` is the tour alone, and means the
same where that share was 0. Any other share stands for `stochastic`.

    {policy: committed, options: {unpredictability: 0.5, random_move: 0.1}}     1.0
    {policy: stochastic}                                                        this version

Files that fogwatch writes state every setting. A section that states all settings of 0.3 without `unpredictability`
was written by 0.3, whose robots never followed a tour.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from patrol.scenario.policies import (
    BUILT_IN,
    COMMITTED,
    DEFAULT,
    OPTION_LENGTHS,
    PAPER,
    STOCHASTIC,
    TOUR_STATED,
    CommitmentOptions,
    PotentialFieldOptions,
)

_POLICIES: Mapping[str, str] = MappingProxyType({"target": DEFAULT, "none": PAPER})
"""Policies of this version by the value of `commitment`."""

_MOVED = frozenset(PotentialFieldOptions.model_fields) - {"fuzzy"}
"""Fields of 0.2's section `patrol` that are settings of policies."""

_DEFAULTS_0_2: Mapping[str, Any] = MappingProxyType(
    {"separation": "claims", "random_move": 0.02, "random_move_for": "all"}
)
"""Defaults of 0.2 for the paper's policy that this version has changed."""

_DEFAULTS: Mapping[str, Any] = MappingProxyType(
    {name: field.get_default() for name, field in PotentialFieldOptions.model_fields.items()} | dict(_DEFAULTS_0_2)
)
_SHARE = "unpredictability"
"""Setting of `committed`: the share of the time of free choices."""

_RANDOM_STEPS: Mapping[str, Any] = MappingProxyType(
    {name: value for name, value in TOUR_STATED.items() if name != _SHARE}
)
"""Settings of free choices that are settings no longer, and the values that they keep."""

_SEE = "docs/compatibility.md"

_STATED_0_3 = frozenset(CommitmentOptions.model_fields) - {"critical_areas"} | _RANDOM_STEPS.keys()
"""Settings of `committed` that every file written by 0.3 states."""

_REPULSION = "repulsion"


def translate_field(field: str) -> str:
    """Translate the dotted name of a field of an earlier version; return any other as it is.

    For example ``patrol.alpha`` is ``patrol.options.alpha`` now.
    """
    section, _, name = field.partition(".")
    return f"patrol.options.{name}" if section == "patrol" and name.partition(".")[0] in _MOVED else field


def translate_overrides(overrides: Mapping[str, Any], patrol: object) -> dict[str, Any]:
    """Translate overrides of an earlier version, by dotted field; leave those of this version as they are.

    For example, ``{"patrol.alpha": 40}`` becomes ``{"patrol.options.alpha": 40}``.

    `patrol` is the section that they are laid over, as this version has it. `commitment` chooses a policy, with the
    defaults of 0.2 where the section has another one. In the result a policy comes first.
    """
    translated: dict[str, Any] = {}
    policy = _POLICIES.get(str(overrides.get("patrol.commitment")))
    if policy is not None and "patrol.policy" not in overrides:
        translated["patrol.policy"] = policy
        before = patrol.get("policy", DEFAULT) if isinstance(patrol, Mapping) else DEFAULT
        if policy == PAPER != before:
            translated |= {f"patrol.options.{name}": value for name, value in _DEFAULTS_0_2.items()}
    for field, value in overrides.items():
        if field == "patrol.avoidance" and value == "fuzzy":
            translated |= {field: "none", "patrol.options.fuzzy": True}
        elif field != "patrol.commitment" or policy is None:
            translated[translate_field(field)] = value
    return translated


def translate_patrol(patrol: Mapping[str, Any], notes: list[str]) -> dict[str, Any]:
    """Translate a section of an earlier version; leave one of this version as it is.

    The section is unchecked, as a file or an override has it. `notes` takes one line for each setting whose meaning
    changes. A section that states `commitment` is one of 0.2, which accepted settings without effect: they are left
    out. In any other they stay, so that they are refused.
    """
    section = {name: value for name, value in patrol.items() if name not in _MOVED}
    moved = {name: value for name, value in patrol.items() if name in _MOVED}
    commitment = str(section.get("commitment"))
    if "options" in section and section["options"] is None:
        del section["options"]
    of_0_2 = commitment in _POLICIES
    if of_0_2:
        del section["commitment"]
        if section.get("policy", PAPER) in BUILT_IN:
            section["policy"] = _POLICIES[commitment]
    policy = section.get("policy", DEFAULT)
    if section.get("avoidance") == "fuzzy":
        section["avoidance"], moved["fuzzy"] = "none", True
    if of_0_2:
        moved = _with_effect(moved, policy)
    options = section.get("options")
    if moved and (options is None or isinstance(options, Mapping)):
        section["options"] = options = {**moved, **(options or {})}
    # No earlier version has stated `stochastic`, so what such a section has is refused where it is no setting.
    if policy in (COMMITTED, STOCHASTIC) and patrol.get("policy") != STOCHASTIC and isinstance(options, Mapping):
        now, section["options"] = _without_free_choices(policy, options, notes)
        if now != policy:
            section["policy"] = now
    return section


def _without_free_choices(policy: str, options: Mapping[str, Any], notes: list[str]) -> tuple[str, dict[str, Any]]:
    """Return policy and settings of this version for settings of `committed` and `stochastic`; notes: see above."""
    remaining = {name: value for name, value in options.items() if name not in _RANDOM_STEPS}
    if policy == COMMITTED:
        share = options.get(_SHARE, 1.0 if options.keys() >= _STATED_0_3 else 0.0)
        if isinstance(share, int | float) and 0.0 <= share <= 1.0:
            remaining.pop(_SHARE, None)
            if share > 0.0:
                notes.append(f"patrol.policy: committed with {_SHARE} {share:g} is {STOCHASTIC} now; see {_SEE}")
                return STOCHASTIC, remaining
    for name, value in _RANDOM_STEPS.items():
        if options.get(name, value) != value:
            notes.append(f"patrol.options.{name} = {options[name]}: left out, as {policy} has it no more; see {_SEE}")
    return policy, remaining


def _with_effect(stated: Mapping[str, Any], policy: object) -> dict[str, Any]:
    """Return the settings of a section of 0.2 that its policy uses."""
    if policy == PAPER:
        return {**_DEFAULTS_0_2, **stated}
    if policy not in (COMMITTED, STOCHASTIC):
        # Resolved files of 0.2 state every field. What is no default may be meant for a class that builds on ours.
        chosen = {name: value for name, value in stated.items() if value != _DEFAULTS.get(name)}
        return {name: value for name, value in chosen.items() if name not in OPTION_LENGTHS}
    used = {name: value for name, value in stated.items() if name in CommitmentOptions.model_fields}
    separation = used.get("separation")
    if separation == _REPULSION:
        used["separation"] = "none"
    elif isinstance(separation, list | tuple):
        used["separation"] = [mechanism for mechanism in separation if mechanism != _REPULSION]
    return used
