"""The scenario: one file that says everything a run depends on.

`load_scenario` reads a file or a mapping, applies overrides and checks every value; `open_scenario` also takes a map
or the name of a built-in terrain. A loaded scenario is resolved: defaults are filled in, lengths that follow the body
are numbers unless robots differ in them, paths are absolute and a nemesis is written out as the faults that it drew. So
it dumps to YAML that means the same anywhere on this machine.
Two scenarios that mean the same have the same `scenario_hash`.
"""

from __future__ import annotations

import copy
import hashlib
import json
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from patrol.classes.class_file import class_file, file_digest, weights_digest
from patrol.errors import BadInput, did_you_mean, quoted
from patrol.files.half_characters import refuse_half_characters
from patrol.files.untrusted import IMAGE, read_untrusted
from patrol.files.yaml_text import line_of, parse_yaml, read_text
from patrol.graph import VISIT_M
from patrol.maps.map_file import IMAGE_ENDINGS, IS_IMAGE, read_map_file
from patrol.pose import TURNS_IN_ARCS
from patrol.scenario.dump import dump_section, notes_on_lengths
from patrol.scenario.explain import one_line
from patrol.scenario.lengths import FIELDS
from patrol.scenario.model import Scenario
from patrol.scenario.nemesis import written_out
from patrol.scenario.older import TOUR_STATED, translate_field, translate_overrides, translate_patrol
from patrol.scenario.policies import (
    BLOCKED_MEMORY_S,
    DEFAULT,
    LATER_OPTIONS,
    LEARNED,
    OPTION_LENGTHS,
    CommittedPatrol,
    LearnedPatrol,
    PaperPatrol,
    PatrolOptions,
)
from patrol.scenario.radio_spec import IDEAL
from patrol.scenario.sections import BUILT_IN_SENSORS, GROUND, RobotEntry, RobotGroup, RobotSpec
from patrol.values import AUTO, BUILTINS

Overrides = Mapping[str, object]

_HASH_FORMAT = "fogwatch-scenario/2"
_ENTRIES = {
    "closures": "{name: door, polygon: [[8, 2], [9, 2], [9, 3]], closed: [[60, 90]]}",
    "docks": "{place: [10, 10]}",
    "faults": "{kind: kill, at: 60, who: one}",
    "intruders": "{place: [10, 10], at: 60}",
    "zones": "{name: vault, polygon: [[2, 2], [8, 2], [8, 6]], weight: 10}",
}
"""The lists that are empty unless given, and what an entry looks like."""
_OWN_CLASSES = (("patrol", "policy"), ("sensor", "kind"), ("radio", "model"))
"""Sections that may name a class of one's own, and the fields that do."""


def load_scenario(
    source: Path | str | Mapping[str, Any],
    overrides: Overrides | None = None,
    *,
    base: Path | None = None,
    called: str = "scenario",
    aliases: Mapping[str, str] | None = None,
    opens_classes: bool = True,
) -> Scenario:
    """Load and resolve the scenario in a YAML file, or in a mapping of the same shape.

    Overrides are values by dotted field (``patrol.give_way``, ``robots.0.speed``; ``robots.speed`` goes to every entry
    of a list); texts are read as YAML. A mapping's relative paths are relative to `base`, the current folder unless
    given; a file's are relative to the file's folder. Errors call a mapping `called`, and a field by its alias instead
    of its dotted name.

    `opens_classes` is whether the files of own classes may be opened, for their hashes; False for a stranger's scenario
    that is only looked at. No other file that a scenario names is opened here. BadInput is one line that names the
    file, the field, the value and the remedy.
    """
    if isinstance(source, Mapping):
        raw = copy.deepcopy(dict(source))
        scenario = _resolve(raw, overrides or {}, called, base or Path.cwd(), None, None, aliases)
    else:
        path = Path(source)
        raw, text = _read_mapping(path)
        scenario = _resolve(raw, overrides or {}, str(path), path.parent, path.stem, text)
    return _with_digests(scenario) if opens_classes else scenario


def open_scenario(what: str, overrides: Overrides | None = None) -> Scenario:
    """Open the scenario that an argument names: a scenario file, a map's YAML file or a built-in terrain."""
    if what in BUILTINS:
        return load_scenario({"terrain": {"builtin": what}}, overrides)
    path = Path(what)
    if path.suffix.lower() in IMAGE_ENDINGS:
        raise BadInput(f"{what}: {IS_IMAGE}")
    if not path.exists():
        raise BadInput(f"{what}: no such scenario or map file, and no built-in terrain; {did_you_mean(what, BUILTINS)}")
    raw, text = _read_mapping(path)
    if "image" in raw and "terrain" not in raw:
        return load_scenario({"terrain": {"map": str(path)}}, overrides)
    scenario = load_scenario(path, overrides)
    line = line_of(text, ("terrain", "map"))
    overridden = not {"terrain", "terrain.map"}.isdisjoint(overrides or ())
    check_map(scenario, "override" if overridden else what if line is None else f"{what}: line {line}")
    return scenario


def check_map(scenario: Scenario, source: str) -> None:
    """Refuse a scenario whose map is not there."""
    if scenario.terrain.map is None:
        return
    path = scenario.base / scenario.terrain.map
    if not os.path.exists(path):  # noqa: PTH110 - Path.exists raises for a name that is too long
        raise BadInput(f"{source}: terrain.map = {path}: no such file; a path is relative to the scenario's folder")


def with_spares(scenario: Scenario, spare: int) -> Scenario:
    """Add spare robots to a scenario, which are not there until they join.

    A scenario that lists its robots is refused.
    """
    if not isinstance(scenario.robots, RobotGroup):
        raise BadInput(f"--spare {spare}: {scenario.name} lists its robots; mark those that are to join as spare: true")
    return load_scenario(as_mapping(scenario), {"robots.spare": spare}, called="--spare")


def parse_overrides(settings: Sequence[str]) -> dict[str, object]:
    """Parse ``FIELD=VALUE`` texts into overrides by dotted field; the later of two for one field wins."""
    overrides: dict[str, object] = {}
    for setting in settings:
        field, equals, value = setting.partition("=")
        if not equals or not field.strip():
            raise BadInput(f"--set {setting}: expected FIELD=VALUE, for example patrol.give_way=false")
        name = translate_field(field.strip())
        overrides.pop(name, None)
        overrides[name] = value
    return overrides


def as_mapping(scenario: Scenario) -> dict[str, Any]:
    """Write a scenario as plain lists, texts and numbers; `load_scenario` gives an equal scenario back."""
    return scenario.model_dump(mode="json", exclude_none=True)


def dump_scenario(scenario: Scenario) -> str:
    """Write a resolved scenario as commented YAML; loading it gives an equal scenario back.

    Where robots differ in a length that follows the body, the field stays ``auto`` and its comment says what it comes
    to for each robot.
    """
    return f"{dump_section(scenario, notes=notes_on_lengths(scenario))}\n"


def scenario_schema() -> dict[str, Any]:
    """Return the JSON schema of a scenario file."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **Scenario.model_json_schema()}


def scenario_hash(scenario: Scenario) -> str:
    """Return the SHA-256 (hex) of what a scenario means.

    Left out are the name and where files lie: a map enters by its content, a tag key only by its presence, robots one
    by one.
    """
    meaning = _meaning(scenario)
    if scenario.terrain.map is not None:
        meaning["terrain"]["map"] = map_digest(scenario.base / scenario.terrain.map)
    for section, field in _OWN_CLASSES:
        _forget_where_a_class_lies(meaning[section], field)
    if isinstance(scenario.patrol, LearnedPatrol):
        options = meaning["patrol"]["options"]
        if (digest := options.pop("weights_sha256")) is not None:
            options["weights"] = [digest, Path(options["weights"]).suffix]
    return _digest({"format": _HASH_FORMAT, **meaning})


def same_but_for_files(one: Scenario, other: Scenario) -> bool:
    """Return True if two scenarios mean the same, as far as can be told without opening what they name.

    Names, the map and the policy's file themselves do not count. Both are resolved; `one` may be a stranger's.
    """
    meanings = [_meaning(scenario) for scenario in (one, other)]
    for meaning in meanings:
        meaning["terrain"]["map"] = meaning["terrain"]["map"] is not None
        for section, field in _OWN_CLASSES:
            if field in meaning[section]:
                meaning[section][field] = meaning[section][field].rpartition(":")[2]
                del meaning[section][f"{field}_sha256"]
        if meaning["patrol"]["policy"] == LEARNED:
            options = meaning["patrol"]["options"]
            options["weights"] = options["weights"] is not None
            del options["weights_sha256"]
    return meanings[0] == meanings[1]


def _meaning(scenario: Scenario) -> dict[str, Any]:
    """Give a scenario's meaning, with that of its files: no names, a key by its presence alone, robots one by one."""
    meaning = scenario.model_dump(mode="json", exclude={"name", "robots", "nemesis"})
    meaning["radio"]["key"] = scenario.radio.key is not None
    if scenario.sensor.kind in BUILT_IN_SENSORS:  # their other settings say it all
        for field in ("kind", "kind_sha256", "options"):
            del meaning["sensor"][field]
    graph = scenario.terrain.graph
    if graph is None:  # as before there were graphs, so that hashes stay
        del meaning["terrain"]["graph"]
    elif graph.visit == VISIT_M:  # as before it could be set
        del meaning["terrain"]["graph"]["visit"]
    if scenario.terrain.patrolled == GROUND:  # as before it could be set
        del meaning["terrain"]["patrolled"]
    if isinstance(scenario.patrol, PaperPatrol):
        for option, before in LATER_OPTIONS.items():
            if meaning["patrol"]["options"][option] == before:  # as before it could be set, so that hashes stay
                del meaning["patrol"]["options"][option]
    if isinstance(scenario.patrol, CommittedPatrol):
        meaning["patrol"]["options"] |= TOUR_STATED  # as before it was the tour alone, so that hashes stay
    if scenario.radio.model == IDEAL:  # as before there were others, so that hashes stay
        for field in ("model", "model_sha256", "options"):
            del meaning["radio"][field]
    _drop_what_is_not_given(meaning)
    meaning["robots"] = [_robot_meaning(spec) for spec in scenario.roster]
    return meaning


def _drop_what_is_not_given(meaning: dict[str, Any]) -> None:
    """Drop zones, docks, closures and what a zone does not say, which came later: hashes stay as before."""
    if not meaning["closures"] and meaning["patrol"]["blocked_memory"] == BLOCKED_MEMORY_S:
        del meaning["patrol"]["blocked_memory"]
    for field in ("zones", "docks", "closures"):
        if not meaning[field]:
            del meaning[field]
    for zone in meaning.get("zones", ()):
        for field in ("speed", "one_way", "times", "weights"):
            if zone[field] is None:
                del zone[field]


def map_digest(path: Path) -> str:
    """Return the SHA-256 (hex) of a map: of what its YAML means and of its image's bytes.

    It does not matter where the two files lie.
    """
    says = read_map_file(path)
    try:
        image = read_untrusted(says.image, IMAGE)
    except OSError as error:
        raise BadInput(f"{path}: image = {says.image}: cannot be read ({error.strerror}); correct 'image'") from None
    return _digest(
        {
            "image": hashlib.sha256(image).hexdigest(),
            "resolution": says.resolution,
            "origin": says.origin,
            "negate": says.negate,
            "occupied_thresh": says.occupied_thresh,
            "free_thresh": says.free_thresh,
            "mode": says.mode,
        }
    )


def _resolve(
    raw: dict[str, Any],
    overrides: Overrides,
    source: str,
    base: Path,
    name: str | None,
    text: str | None,
    aliases: Mapping[str, str] | None = None,
) -> Scenario:
    """Apply the overrides and check every value; text: of the file that the mapping was read from, or None."""
    notes: list[str] = []
    if isinstance(raw.get("patrol"), dict):
        raw["patrol"] = translate_patrol(raw["patrol"], notes)
    patrol = raw.get("patrol")
    overrides = translate_overrides(overrides, patrol)
    if "patrol.policy" in overrides and isinstance(patrol, dict):
        patrol.pop("policy_sha256", None)  # it is of the policy that is replaced, and so are its settings
        if overrides["patrol.policy"] != patrol.get("policy", DEFAULT):
            patrol.pop("options", None)
            notes.clear()
    if "patrol.options.weights" in overrides and isinstance(patrol, dict) and isinstance(patrol.get("options"), dict):
        patrol["options"].pop("weights_sha256", None)
    if "sensor.kind" in overrides and isinstance(raw.get("sensor"), dict):
        for field in ("kind_sha256", "options"):
            raw["sensor"].pop(field, None)
    radio = raw.get("radio")
    if "radio.model" in overrides and isinstance(radio, dict):
        radio.pop("model_sha256", None)
        if overrides["radio.model"] != radio.get("model", IDEAL):
            radio.pop("options", None)
    for field, value in overrides.items():
        _override(raw, field, value)
    if "patrol" in overrides and isinstance(raw["patrol"], dict):
        raw["patrol"] = translate_patrol(raw["patrol"], notes)
    raw.setdefault("name", _default_name(raw, name))
    refuse_half_characters(raw, source)
    try:
        scenario = _with_lengths(written_out(Scenario.model_validate(raw, context={"base": base})))
    except ValidationError as error:
        places = (lambda _: None) if text is None else partial(_line_of_field, text)
        raise BadInput(one_line(error, source, tuple(overrides), places, aliases or {})) from None
    scenario.__dict__["translated"] = tuple(f"{source}: {note}" for note in notes)
    return scenario


def _line_of_field(text: str, location: Sequence[int | str]) -> int | None:
    """Find the line of a field, or of the one around it; in 0.2, a policy's settings stand in the section `patrol`."""
    places = [location, [*location[:1], *location[2:]]] if location[1:2] == ["options"] else [location]
    return max((line for location_part in places if (line := line_of(text, location_part)) is not None), default=None)


def _read_mapping(path: Path) -> tuple[dict[str, Any], str]:
    """Read a file's mapping, and its text."""
    text = read_text(path)
    raw = parse_yaml(text, str(path))
    if raw is None:
        raise BadInput(f"{path}: is empty; give at least 'terrain: {{builtin: yards}}'")
    if not isinstance(raw, dict):
        raise BadInput(f"{path}: holds {quoted(raw)}; expected keys and values such as 'terrain: {{builtin: yards}}'")
    if "base" in raw and "terrain" not in raw:
        raise BadInput(f"{path}: is a sweep of many runs; make them with: fogwatch sweep {path}, or name its base")
    return raw, text


def _default_name(raw: Mapping[str, Any], stem: str | None) -> str:
    terrain = raw.get("terrain")
    if stem is None and isinstance(terrain, Mapping):
        stem = str(terrain.get("builtin") or Path(str(terrain.get("map") or "")).stem)
    fitting = re.sub(r"[^A-Za-z0-9._-]+", "-", stem or "").strip("._-")[:64]
    return fitting or "scenario"


def _override(raw: dict[str, Any], field: str, value: object) -> None:
    """Set one dotted field of a scenario's raw mapping."""
    if isinstance(value, str):
        value = parse_yaml(value, f"override {field}")
    parts = field.split(".")
    if not all(parts):
        raise BadInput(f"override {field!r}: is not a field; write for example patrol.give_way")
    top = parts[0]
    if top in _ENTRIES and parts[1:] and parts[1].isdecimal() and not raw.get(top):
        raise BadInput(f"override {field}: {top} is an empty list; give entries: {top}=[{_ENTRIES[top]}]")
    _set(raw, parts, copy.deepcopy(value), field)


def _set(node: Any, parts: list[str], value: object, field: str) -> None:
    head, rest = parts[0], parts[1:]
    if isinstance(node, dict):
        if head.isdecimal():
            raise BadInput(f"override {field}: not a list, so there is no entry {head}; leave .{head} out")
        if not rest:
            node[head] = value
            return
        if node.get(head) is None:
            node[head] = {}
        _set(node[head], rest, value, field)
    elif isinstance(node, list) and head.isdecimal():
        if int(head) >= len(node):
            raise BadInput(f"override {field}: there is no entry {head}; the list has entries 0 to {len(node) - 1}")
        if rest:
            _set(node[int(head)], rest, value, field)
        else:
            node[int(head)] = value
    elif isinstance(node, list) and field.startswith("robots.") and head in RobotEntry.model_fields:
        for entry in node:
            _set(entry, parts, value, field)
    elif isinstance(node, list):
        of_group = field.startswith("robots.") and head in RobotGroup.model_fields
        raise BadInput(
            f"override {field}: the scenario lists its {len(node)} robots; add or remove entries there"
            if of_group
            else f"override {field}: this is a list of {len(node)}; give an index, 0 to {len(node) - 1}"
        )
    else:
        raise BadInput(f"override {field}: {quoted(node)} has no field {head}; leave .{'.'.join(parts)} out")


def _with_digests(scenario: Scenario) -> Scenario:
    """Add the SHA-256 of the files of own classes and trained networks, where the scenario does not have them yet."""
    digests: dict[str, Any] = {}
    for name, field in _OWN_CLASSES:
        section = getattr(scenario, name)
        path = class_file(getattr(section, field))
        if path is not None and getattr(section, f"{field}_sha256") is None and path.is_file():
            digests[name] = section.model_copy(update={f"{field}_sha256": file_digest(path, f"{name}.{field}")})
    patrol = scenario.patrol
    if isinstance(patrol, LearnedPatrol) and patrol.options.weights is not None:
        weights = Path(patrol.options.weights)
        if patrol.options.weights_sha256 is None and weights.is_file():
            options = patrol.options.model_copy(update={"weights_sha256": weights_digest(weights)})
            digests["patrol"] = patrol.model_copy(update={"options": options})
    return scenario.model_copy(update=digests) if digests else scenario


def _with_lengths(scenario: Scenario) -> Scenario:
    """Write out each length that follows the body and is the same for all robots."""
    patrol = scenario.patrol
    common = _common_lengths(scenario, FIELDS, patrol)
    if isinstance(patrol.options, PatrolOptions):
        common["options"] = patrol.options.model_copy(update=_common_lengths(scenario, OPTION_LENGTHS, patrol.options))
    return scenario.model_copy(update={"patrol": patrol.model_copy(update=common)}) if common else scenario


def _common_lengths(scenario: Scenario, names: Iterable[str], section: object) -> dict[str, Any]:
    """Resolve each ``auto`` of a section that is the same for all robots; m."""
    auto = [name for name in names if getattr(section, name, None) == AUTO]
    by_name = {name: {getattr(lengths, name) for lengths in scenario.lengths.values()} for name in auto}
    return {name: lengths.pop() for name, lengths in by_name.items() if len(lengths) == 1}


def _forget_where_a_class_lies(section: dict[str, Any], field: str) -> None:
    """Let a policy or a sensor enter by its file's content."""
    digest = section.pop(f"{field}_sha256", None)
    if digest is not None:
        section[field] = [digest, section[field].rpartition(":")[2]]


def _robot_meaning(spec: RobotSpec) -> list[Any]:
    start = None if spec.start is None else [spec.start.x, spec.start.y, spec.start.heading]
    turning = spec.turning_radius if spec.model in TURNS_IN_ARCS else None
    meaning = [spec.name, spec.model, spec.speed, spec.radius, turning, start]
    if spec.spare:
        meaning.append("spare")
    if spec.battery is not None:
        meaning.append(spec.battery.model_dump(mode="json"))
    return meaning


def _digest(meaning: Mapping[str, Any]) -> str:
    text = json.dumps(meaning, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()
