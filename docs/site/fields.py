"""The reference of the scenario's fields, as Markdown, from the schema that ``fogwatch scenario schema`` prints."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from patrol.scenario import scenario_schema

Schema = Mapping[str, Any]

CHOSEN_BY = ("kind", "policy", "model")
"""Fields by whose value one of several models is chosen."""

BOUNDS = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
FINITE = 1e9
"""The bound that stands for "any finite number"."""

WORDS = {"object": "mapping", "null": "`null`", "boolean": "`true` or `false`"}
"""Names of JSON's types in words of YAML."""


def fields() -> str:
    """Return a section for the scenario and for each model in it, from the outside to the inside."""
    schema = scenario_schema()
    models = schema["$defs"]
    sections = [_section("## The file", schema)]
    waiting, seen = [("", schema)], set[str]()
    while waiting:
        path, model = waiting.pop(0)
        for name, field in model["properties"].items():
            place = f"{path}.{name}" if path else name
            alternatives = list(_models(field))
            for child in alternatives:
                if child in seen:
                    continue
                seen.add(child)
                waiting.append((place, models[child]))
                first = models[alternatives[0]] if child != alternatives[0] else None
                chosen = f", {_choice(child, models[child])}" if len(alternatives) > 1 else ""
                sections.append(_section(f"### `{place}`{chosen}", models[child], first))
    return "\n\n".join(sections)


def _section(heading: str, model: Schema, first: Schema | None = None) -> str:
    """Return a model's heading, description and fields; of an alternative to `first`, the fields that differ."""
    same = {} if first is None else first["properties"]
    required = model.get("required", [])
    lines = [
        _field(name, field, name in required) for name, field in model["properties"].items() if field != same.get(name)
    ]
    rest = [name for name, field in model["properties"].items() if field == same.get(name)]
    if rest:
        lines.append(f"\nAs in the first of these sections: {', '.join(f'`{name}`' for name in rest)}.")
    return f"{heading}\n\n{model.get('description', '')}\n\n" + "\n".join(lines)


def _field(name: str, field: Schema, required: bool) -> str:
    """Return a field's line: its name, what it may be, its default and its meaning."""
    facts = [" or ".join(dict.fromkeys(_kinds(field)))]
    if required:
        facts.append("required")
    elif (default := field.get("default")) not in (None, [], {}):
        facts.append(f"default `{json.dumps(default, ensure_ascii=False)}`")
    return f"- **`{name}`** ({', '.join(fact for fact in facts if fact)}): {field.get('description', '')}"


def _kinds(field: Schema) -> Iterator[str]:
    """Yield what a field's value may be, in words."""
    if alternatives := field.get("anyOf") or field.get("oneOf"):
        for alternative in alternatives:
            yield from _kinds(alternative)
    elif "$ref" in field:
        yield "mapping"
    elif "const" in field:
        yield f"`{field['const']}`"
    elif "enum" in field:
        yield from (f"`{value}`" for value in field["enum"])
    elif field.get("type") == "array":
        parts = [*([field["items"]] if field.get("items") else []), *field.get("prefixItems", ())]
        inner = [kind for part in parts for kind in _kinds(part)]
        yield f"list of {' or '.join(dict.fromkeys(inner))}" if inner else "list"
    elif kind := field.get("type"):
        yield " ".join([WORDS.get(kind, str(kind)), " and ".join(_bounds(field))]).rstrip()


def _bounds(field: Schema) -> Iterator[str]:
    """Yield the bounds of a number that say more than that it is finite."""
    for key, sign in BOUNDS.items():
        if (value := field.get(key)) is not None and abs(value) < FINITE:
            yield f"{sign} {value:g}"


def _models(field: Schema) -> Iterator[str]:
    """Yield the names of the models that a field's value may be or hold."""
    if "$ref" in field:
        yield field["$ref"].rpartition("/")[2]
    for key in ("anyOf", "oneOf", "prefixItems"):
        for alternative in field.get(key, ()):
            yield from _models(alternative)
    for key in ("items", "additionalProperties"):
        if isinstance(field.get(key), Mapping):
            yield from _models(field[key])


def _choice(name: str, model: Schema) -> str:
    """Return what tells a model from the others that may stand in its place."""
    for key in CHOSEN_BY:
        if key in model["properties"] and "const" in model["properties"][key]:
            return f"`{key}: {model['properties'][key]['const']}`"
    return name
