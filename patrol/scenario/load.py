"""The scenario: one file that says everything a run depends on.

`load_scenario` reads a file or a mapping, applies overrides and checks every value; `open_scenario` also takes a map
or the name of a built-in terrain. A loaded scenario is resolved: defaults are filled in, lengths that follow the body
are numbers unless robots differ in them, paths are absolute and a nemesis is written out as the faults that it drew. So
it dumps to YAML that means the same anywhere on this machine.
Two scenarios that mean the same have the same `scenario_hash`.

The nemesis draws random faults into a concrete timeline when a scenario is loaded. In each interval one fault begins,
at a drawn tick and of a drawn kind, and lasts for 0.3 to 2 intervals. All have ended before the quiet window at the end
of the run: killed robots are started again, paused ones go on, and those that left join again. A robot suffers one
process fault at a time, and there is always one that suffers none.
"""

from __future__ import annotations

import copy
import math
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from patrol.errors import BadInput, did_you_mean, quoted
from patrol.faults.kinds import Join, Leave
from patrol.faults.nemesis import DRAWN, RobotsHit, When, draw_fault, room_for
from patrol.files.foreign import kind_of_mapping
from patrol.files.untrusted import refuse_half_characters
from patrol.files.yaml_text import line_of, parse_yaml, read_text
from patrol.maps.map_file import IMAGE_ENDINGS, IS_IMAGE
from patrol.random import Draws, Purpose
from patrol.scenario.dump import dump_section, notes_on_lengths
from patrol.scenario.explain import SECTIONS, one_line
from patrol.scenario.lengths import FIELDS
from patrol.scenario.model import Scenario
from patrol.scenario.policies import DEFAULT, OPTION_LENGTHS, PatrolOptions, PatrolSpec
from patrol.scenario.radio_spec import IDEAL, RadioSpec
from patrol.scenario.sections import SECTOR, RobotEntry, RobotGroup, SensorSpec
from patrol.scenario.step import automatic_step
from patrol.values import AUTO, BUILTINS, Section, digest_of

Overrides = Mapping[str, object]

ANNOUNCED = {"": ("point", "step"), "robots": ("model", "radius", "speed", "turning_radius"), "sensor": ("range",)}
"""Fields, by section, of which a run says whether its scenario states them."""

FILE = "scenario.yaml"
"""The scenario's file in a run's folder."""

_CHANGES_STEP = frozenset({"point", "radio", "robots", "terrain"})
"""Sections on which the step of a scenario depends that states none."""

_HASH_FORMAT = "fogwatch-scenario/2"
_CLASSES = ((PatrolSpec, DEFAULT), (SensorSpec, SECTOR), (RadioSpec, IDEAL))
"""Sections that may name a class of one's own, and what they name by default."""


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

    `opens_classes` is whether the files of own classes may be opened, for their hashes, and the map, for a step that
    follows its ground; False for a stranger's scenario that is only looked at. No other file that a scenario names is
    opened here. BadInput is one line that names the file, the field, the value and the remedy.
    """
    name = text = None
    if isinstance(source, Mapping):
        raw, base = copy.deepcopy(dict(source)), base or Path.cwd()
    else:
        path = Path(source)
        raw, text = _read_mapping(path)
        called, base, name = str(path), path.parent, path.stem
    scenario = _resolve_scenario(raw, overrides or {}, called, base, name, text, opens_classes, aliases or {})
    return scenario.with_digests() if opens_classes else scenario


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
    return changed_scenario(scenario, {"robots.spare": spare}, called="--spare")


def changed_scenario(scenario: Scenario, overrides: Overrides, called: str = "scenario") -> Scenario:
    """Return a loaded scenario with overrides by dotted field, which knows what its source said."""
    if "step" in scenario.assumed and not _CHANGES_STEP.isdisjoint(name.partition(".")[0] for name in overrides):
        overrides = {"step": AUTO, **overrides}
    changed = load_scenario(as_mapping(scenario), overrides, called=called)
    overridden = {field for field in scenario.assumed for name in overrides if f"{field}.".startswith(f"{name}.")}
    return with_assumed(changed, changed.assumed | (scenario.assumed - overridden))


def with_assumed(scenario: Scenario, assumed: frozenset[str]) -> Scenario:
    """Return a copy of a scenario that knows what its source leaves out."""
    noted = scenario.model_copy()
    noted.__dict__["assumed"] = assumed
    return noted


def parse_overrides(settings: Sequence[str]) -> dict[str, object]:
    """Parse ``FIELD=VALUE`` texts into overrides by dotted field; the later of two for one field wins."""
    overrides: dict[str, object] = {}
    for setting in settings:
        field, equals, value = setting.partition("=")
        if not equals or not field.strip():
            raise BadInput(f"--set {setting}: expected FIELD=VALUE, for example patrol.give_way=false")
        name = field.strip()
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


def keep_scenario(scenario: Scenario, folder: Path) -> Path:
    """Write a resolved scenario with copies of its map, own classes and network, and return its new file.

    So it runs again wherever the folder is moved to. A fleet's key is a secret and is not copied: the scenario goes on
    naming its file. The folder must exist, and have no such copies yet. A file that cannot be read raises BadInput, a
    folder that cannot be written to OSError.
    """
    path = folder / FILE
    path.write_text(dump_scenario(scenario.with_copies(folder)), encoding="utf-8")
    return path


def scenario_schema() -> dict[str, Any]:
    """Return the JSON schema of a scenario file."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **Scenario.model_json_schema()}


def scenario_hash(scenario: Scenario) -> str:
    """Return the SHA-256 (hex) of what a scenario means.

    Left out are the name and where files lie: a map enters by its content, a tag key only by its presence, robots one
    by one.
    """
    return digest_of({"format": _HASH_FORMAT, **scenario.meaning()})


def same_but_for_files(one: Scenario, other: Scenario) -> bool:
    """Return True if two scenarios mean the same, as far as can be told without opening what they name.

    Names, the map and the policy's file themselves do not count. Both are resolved; `one` may be a stranger's.
    """
    return one.meaning(files=False) == other.meaning(files=False)


def _resolve_scenario(
    raw: dict[str, Any],
    overrides: Overrides,
    source: str,
    base: Path,
    name: str | None,
    text: str | None,
    opens_classes: bool,
    aliases: Mapping[str, str],
) -> Scenario:
    """Apply the overrides and check every value; text: of the file that the mapping was read from, or None."""
    patrol = raw.get("patrol")
    for section, default in _CLASSES:
        top, _, field = section.NAMED.partition(".")
        entry = raw.get(top)
        if section.NAMED in overrides and isinstance(entry, dict):
            entry.pop(f"{field}_sha256", None)  # it is of the class that is replaced, and so are its settings
            if overrides[section.NAMED] != entry.get(field, default):
                entry.pop("options", None)
    if "patrol.options.weights" in overrides and isinstance(patrol, dict) and isinstance(patrol.get("options"), dict):
        patrol["options"].pop("weights_sha256", None)
    for field, value in overrides.items():
        _override_field(raw, field, value)
    raw.setdefault("name", _default_name(raw, name))
    refuse_half_characters(raw, source)
    if follows := raw.get("step", AUTO) == AUTO:
        raw.pop("step", None)
    try:
        context = {"base": base, "opens_classes": opens_classes}
        scenario = Scenario.model_validate(raw, context=context)
        assumed = _left_out(scenario)
        if follows and opens_classes:
            raw["step"] = automatic_step(scenario.terrain, scenario.point, scenario.roster, scenario.radio)
            scenario = Scenario.model_validate(raw, context=context)
        scenario = _with_lengths(_written_out(scenario))
    except ValidationError as error:
        places = (lambda _: None) if text is None else partial(line_of, text)
        raise BadInput(one_line(error, source, tuple(overrides), places, aliases)) from None
    return with_assumed(scenario, assumed)


def _left_out(scenario: Scenario) -> frozenset[str]:
    """Return the fields of `ANNOUNCED` that a source leaves out, for one robot or more."""
    robots = scenario.robots if isinstance(scenario.robots, tuple) else (scenario.robots,)
    parts: Mapping[str, Sequence[Section]] = {"": (scenario,), "robots": robots, "sensor": (scenario.sensor,)}
    fields = ((section, name) for section, names in ANNOUNCED.items() for name in names)
    return frozenset(
        f"{section}.{name}".lstrip(".")
        for section, name in fields
        if any(name not in part.model_fields_set for part in parts[section])
    )


def _read_mapping(path: Path) -> tuple[dict[str, Any], str]:
    """Read a file's mapping, and its text."""
    text = read_text(path)
    raw = parse_yaml(text, str(path))
    if raw is None:
        raise BadInput(f"{path}: is empty; give at least 'terrain: {{builtin: yards}}'")
    if not isinstance(raw, dict):
        raise BadInput(f"{path}: holds {quoted(raw)}; expected keys and values such as 'terrain: {{builtin: yards}}'")
    if "terrain" not in raw and (what := kind_of_mapping(raw)):
        raise BadInput(f"{path}: {what}")
    if "base" in raw and "terrain" not in raw:
        raise BadInput(f"{path}: is a sweep of many runs; make them with: fogwatch sweep {path}, or name its base")
    return raw, text


def _default_name(raw: Mapping[str, Any], stem: str | None) -> str:
    terrain = raw.get("terrain")
    if stem is None and isinstance(terrain, Mapping):
        stem = str(terrain.get("builtin") or Path(str(terrain.get("map") or "")).stem)
    fitting = re.sub(r"[^A-Za-z0-9._-]+", "-", stem or "").strip("._-")[:64]
    return fitting or "scenario"


def _override_field(raw: dict[str, Any], field: str, value: object) -> None:
    """Set one dotted field of a scenario's raw mapping."""
    if isinstance(value, str):
        value = parse_yaml(value, f"override {field}")
    parts = field.split(".")
    if not all(parts):
        raise BadInput(f"override {field!r}: is not a field; write for example patrol.give_way")
    top = parts[0]
    example = SECTIONS[top].EXAMPLE if top in SECTIONS else ""
    if example and parts[1:] and parts[1].isdecimal() and not raw.get(top):
        raise BadInput(f"override {field}: {top} is an empty list; give entries: {top}=[{example}]")
    _set_field(raw, parts, copy.deepcopy(value), field)


def _set_field(node: Any, parts: list[str], value: object, field: str) -> None:
    head, tail = parts[0], parts[1:]
    if isinstance(node, dict):
        if head.isdecimal():
            raise BadInput(f"override {field}: not a list, so there is no entry {head}; leave .{head} out")
        if not tail:
            node[head] = value
            return
        if node.get(head) is None:
            node[head] = {}
        _set_field(node[head], tail, value, field)
    elif isinstance(node, list) and head.isdecimal():
        if int(head) >= len(node):
            raise BadInput(f"override {field}: there is no entry {head}; the list has entries 0 to {len(node) - 1}")
        if tail:
            _set_field(node[int(head)], tail, value, field)
        else:
            node[int(head)] = value
    elif isinstance(node, list) and field.startswith("robots.") and head in RobotEntry.model_fields:
        for entry in node:
            _set_field(entry, parts, value, field)
    elif isinstance(node, list):
        of_group = field.startswith("robots.") and head in RobotGroup.model_fields
        raise BadInput(
            f"override {field}: the scenario lists its {len(node)} robots; add or remove entries there"
            if of_group
            else f"override {field}: this is a list of {len(node)}; give an index, 0 to {len(node) - 1}"
        )
    else:
        raise BadInput(f"override {field}: {quoted(node)} has no field {head}; leave .{'.'.join(parts)} out")


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


SHORTEST_FAULT, LONGEST_FAULT = 0.3, 2.0
"""Shortest and longest time of a fault, in intervals."""


def _written_out(scenario: Scenario) -> Scenario:
    """Replace a scenario's nemesis by concrete faults, by the intervals they begin in, after those that it has.

    They depend on the nemesis, the roster, the seed, the step and the duration, and on spare robots that the scenario's
    own faults let join or leave.
    """
    spec, step = scenario.nemesis, scenario.step
    if spec is None:
        return scenario
    end, width = room_for(spec, step, scenario.ticks)
    seed = scenario.seed if spec.seed is None else spec.seed
    kinds = tuple(DRAWN) if spec.kinds == "all" else spec.kinds
    robots = RobotsHit([robot.name for robot in scenario.roster if not robot.spare], _coming_and_going(scenario))
    taken_ids = {fault.id for fault in scenario.faults}
    drawn: list[dict[str, Any]] = []
    for slot in range(math.ceil(end / width)):
        draws = Draws(seed, Purpose.NEMESIS, slot)
        first = math.ceil(slot * width)
        begin = draws.whole(first, max(first, min(end, math.ceil((slot + 1) * width)) - 1))
        length = max(1, round(width * draws.between(SHORTEST_FAULT, LONGEST_FAULT)))
        if begin < end:
            when = When(step, begin, min(end, begin + length))
            drawn += _number_faults(draw_fault(draws, kinds, robots, when), slot + 1, taken_ids)
    mapping = scenario.model_dump(mode="json", exclude_none=True, exclude={"nemesis"})
    return Scenario.model_validate(mapping | {"faults": mapping["faults"] + drawn})


def _coming_and_going(scenario: Scenario) -> set[str]:
    """Find the robots that the scenario's own faults may let join or leave."""
    names = {robot.name for robot in scenario.roster}
    coming_and_going: set[str] = set()
    for fault in scenario.faults:
        if isinstance(fault, Join | Leave):
            who = {fault.who} if isinstance(fault.who, str) else fault.who if isinstance(fault.who, tuple) else names
            coming_and_going |= names.intersection(who) or names
    return coming_and_going


def _number_faults(faults: list[dict[str, Any]], number: int, taken: set[str | None]) -> list[dict[str, Any]]:
    """Give a fault and what heals it ids that no other fault has."""
    name = f"n{number}"
    while taken.intersection((name, f"{name}-heals")):
        name = f"{name}x"
    return [{"id": name if index == 0 else f"{name}-heals", **fault} for index, fault in enumerate(faults)]
