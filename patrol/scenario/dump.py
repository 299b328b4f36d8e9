"""Sections of a scenario as commented YAML."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import yaml

from patrol.files.yaml_text import add_core_rules
from patrol.scenario.lengths import FIELDS
from patrol.scenario.model import Scenario
from patrol.scenario.policies import OPTION_LENGTHS
from patrol.values import AUTO, Section

_COMMENT_COLUMN = 32
_MOST_NAMES = 8
"""Robots of one length that a note names."""

_NO_NOTES: Mapping[str, str] = MappingProxyType({})


class _Dumper(yaml.SafeDumper):
    """Writes texts so that readers by YAML 1.1 and by 1.2 both see texts."""

    yaml_implicit_resolvers = {  # noqa: RUF012 - PyYAML's protocol
        first: list(rules) for first, rules in yaml.SafeDumper.yaml_implicit_resolvers.items()
    }

    def ignore_aliases(self, _data: Any) -> bool:
        return True


add_core_rules(_Dumper)


def dump_section(section: Section, indent: int = 0, notes: Mapping[str, str] = _NO_NOTES, inside: str = "") -> str:
    """Write a section as YAML, one field a line, each with its description; None values are comments.

    `notes` are added to descriptions, by dotted field. `inside` is the dotted name of the section with a full stop
    behind it; empty for a whole scenario.
    """
    lines = []
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        start = f"{' ' * indent}{name}:"
        note = "; ".join(filter(None, (field.description, notes.get(f"{inside}{name}"))))
        if value is None:
            lines.append(_align_note(f"{' ' * indent}# {field.alias or name}:", note))
        elif isinstance(value, Section):
            lines += [_align_note(start, note), dump_section(value, indent + 2, notes, f"{inside}{name}.")]
        elif isinstance(value, tuple) and value and isinstance(value[0], Section):
            entries = [entry.model_dump(mode="json", exclude_none=True) for entry in value]
            lines += [_align_note(start, note), *(f"{' ' * indent}  - {_flow_text(entry)}" for entry in entries)]
        else:
            lines.append(_align_note(f"{start} {_flow_text(value)}", note))
    return "\n".join(lines)


def notes_on_lengths(scenario: Scenario) -> Mapping[str, str]:
    """Describe the lengths of fields that stay ``auto``, for the robots of a mixed team, by dotted field.

    A line is such as ``here 6.6 for truck, 1.65 for scout-1 and scout-2``. The scenario is loaded, so that a field is
    ``auto`` only where robots differ.
    """
    notes = {}
    sections = (("patrol", scenario.patrol, FIELDS), ("patrol.options", scenario.patrol.options, OPTION_LENGTHS))
    for section, fields, name in ((dotted, fields, name) for dotted, fields, names in sections for name in names):
        if getattr(fields, name, None) != AUTO:
            continue
        robots: dict[float, list[str]] = {}
        for spec in scenario.roster:
            robots.setdefault(getattr(scenario.lengths[spec.number], name), []).append(spec.name)
        notes[f"{section}.{name}"] = "here " + ", ".join(
            f"{length:g} for {_join_names(names)}" for length, names in robots.items()
        )
    return notes


def _align_note(text: str, note: str) -> str:
    return f"{text:<{_COMMENT_COLUMN}} # {note}" if note else text


def _flow_text(value: Any) -> str:
    """Write a value on one line, with escapes for characters that a terminal might act on, as bidirectional marks."""
    text = _dump_value(value, allow_unicode=True)
    return text if text.isprintable() else _dump_value(value, allow_unicode=False)


def _dump_value(value: Any, *, allow_unicode: bool) -> str:
    text = yaml.dump(
        value, Dumper=_Dumper, default_flow_style=True, sort_keys=False, width=2**31, allow_unicode=allow_unicode
    )
    return text.removesuffix("...\n").strip()


def _join_names(names: list[str]) -> str:
    """Join names to ``a, b and c``, or to the first few and how many more there are."""
    if len(names) > _MOST_NAMES:
        names = [*names[:_MOST_NAMES], f"{len(names) - _MOST_NAMES} more"]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
