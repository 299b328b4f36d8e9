"""The errors of a scenario, in one line that a person can act on."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from difflib import get_close_matches

from pydantic import ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from patrol.errors import BadInput, NotPrepared, did_you_mean, quoted
from patrol.faults.kinds import KINDS, Fault, Forgery, Jitter, Jump, Slip, Wait
from patrol.faults.nemesis import NemesisSpec
from patrol.faults.targets import Some
from patrol.scenario.closures import ClosureSpec
from patrol.scenario.model import Scenario
from patrol.scenario.policies import (
    COMMITTED,
    DEFAULT,
    PAPER,
    STOCHASTIC,
    CommittedOptions,
    PatrolSpec,
    PotentialFieldOptions,
    StochasticOptions,
)
from patrol.scenario.radio_spec import MODEL_OPTIONS, AdaptiveSpec, BudgetSpec, RadioSpec
from patrol.scenario.sections import (
    DockSpec,
    GraphSpec,
    IntruderSpec,
    RobotEntry,
    RobotGroup,
    SensorSpec,
    TerrainSpec,
)
from patrol.scenario.zones import ZoneSpec
from patrol.values import BUILTINS, Section

MEANT = {"time": "at", "begin": "at", "start": "at", "duration": "for", "robot": "who", "robots": "who"}
"""What people call some keys of faults."""

_SECTIONS: dict[str, type[Section]] = {
    "terrain": TerrainSpec,
    "sensor": SensorSpec,
    "patrol": PatrolSpec,
    "radio": RadioSpec,
    "closures": ClosureSpec,
    "docks": DockSpec,
    "intruders": IntruderSpec,
    "faults": Fault,
    "nemesis": NemesisSpec,
    "zones": ZoneSpec,
}
_OPTIONS: dict[str, type[Section]] = {
    f"={COMMITTED}": CommittedOptions,
    f"={STOCHASTIC}": StochasticOptions,
    f"={PAPER}": PotentialFieldOptions,
    **{f"={model}": options for model, options in MODEL_OPTIONS.items()},
}
_OF_RADIO: dict[str, type[Section]] = {"budget": BudgetSpec, "adaptive": AdaptiveSpec}
_OF_FAULTS: dict[str, type[Section]] = {
    **dict.fromkeys(("who", "from", "to", "as"), Some),
    "delay": Wait,
    "payload": Forgery,
    "jump": Jump,
    "jitter": Jitter,
    "slip": Slip,
}
_UNKNOWN = ("extra_forbidden", "invalid_key")


LineOf = Callable[[Sequence[int | str]], int | None]
"""Path of keys and indices -> the line of the source where it stands, None when it does not."""


def one_line(
    error: ValidationError,
    source: str,
    overridden: Collection[str],
    line_of: LineOf,
    aliases: Mapping[str, str],
) -> str:
    """Write the first problem as ``source: line 3: field = value: problem``, and count the others.

    Unknown keys come first. `source` is the file, or what a mapping is called. `overridden` has the dotted fields that
    were given as overrides and not by the source; `aliases` is what to call a field instead of its dotted name.
    """
    problems = sorted(error.errors(include_url=False), key=lambda problem: problem["type"] not in _UNKNOWN)
    line = _describe(problems[0], source, overridden, line_of, aliases)
    more = len(problems) - 1
    return f"{line} (and {more} more {'problem' if more == 1 else 'problems'})" if more else line


@contextmanager
def naming(source: object, overridden: Collection[str] = ()) -> Iterator[None]:
    """Name the file of a scenario in the error of preparing it.

    The error is such as ``site.yaml: docks.0.place = [5, 5]: ...``. An error that is about a field in `overridden`
    (dotted) names no file, and one that names the file stays as it is. A built-in terrain is no file, and is not named.
    """
    try:
        yield
    except NotPrepared as error:
        text, name = str(error), str(source)
        where = text.partition(": ")[0]
        if name in BUILTINS or where.endswith(name) or _is_overridden(where.partition(" ")[0], overridden):
            raise
        raise BadInput(f"{name}: {text}") from None


def _describe(
    problem: ErrorDetails,
    source: str,
    overridden: Collection[str],
    line_of: LineOf,
    aliases: Mapping[str, str],
) -> str:
    context = problem.get("ctx", {})
    location = _location(problem)
    if problem["type"] == "crossed" and context["field"]:
        location += [int(part) if part.isdecimal() else part for part in context["field"].split(".")]
    field = ".".join(str(part) for part in location)
    if _is_overridden(field, overridden):
        where = f"override {field}"
    else:
        line = line_of(location)
        field = _called(field, aliases)
        where = f"{source}: {field}" if line is None else f"{source}: line {line}: {field}"
    section, note = _known_at(problem["loc"])
    match problem["type"]:
        case "extra_forbidden" | "invalid_key":
            return f"{where}: {_unknown_key(str(location[-1]), section)}"
        case "missing":
            return f"{where}: missing; give {note or 'it'}"
        case "crossed":
            return f"{where}{context['value']}: {context['problem']}"
    expected = _expected(problem, section)
    if note and (context.get("bare") or problem["type"] == "tuple_type"):
        expected = f"{expected} ({note})"
    return f"{where} = {quoted(problem['input'])}: {expected}"


def _location(problem: ErrorDetails) -> list[int | str]:
    """Locate a problem, without the names of kinds (``=kill``), which stand for no key; a key may look like one."""
    location = problem["loc"]
    keys = [part for part in location if not str(part).startswith("=")]
    if problem["type"] in ("extra_forbidden", "invalid_key") and keys[-1:] != [location[-1]]:
        keys.append(location[-1])
    return keys


def _expected(problem: ErrorDetails, section: type[Section]) -> str:
    context = problem.get("ctx", {})
    match problem["type"]:
        case "expected":
            return f"expected {context['what']}"
        case "literal_error":
            allowed = context["expected"].replace("'", "")
            near = get_close_matches(str(problem["input"]).lower(), re.split(r", | or ", allowed), n=1, cutoff=0.6)
            return f"expected {allowed}{f'; did you mean {near[0]}?' if near else ''}"
        case "model_type":
            return f"expected keys and values ({', '.join(_keys(section))})"
        case "too_long":
            return f"expected at most {context['max_length']} of them"
        case "tuple_type":
            return "expected a list"
        case _:
            return problem["msg"]


def _called(field: str, aliases: Mapping[str, str]) -> str:
    for name, alias in aliases.items():
        if field == name or field.startswith(f"{name}."):
            return f"{alias}{field[len(name) :]}"
    return field


def _is_overridden(field: str, overridden: Collection[str]) -> bool:
    """Return True if an override gave the field, or a part of it or around it; robots.speed gave robots.0.speed too."""
    everywhere = ".".join(part for part in field.split(".") if not part.isdecimal())
    return any(
        spelled == name or spelled.startswith(f"{name}.") or name.startswith(f"{spelled}.")
        for name in overridden
        for spelled in (field, everywhere)
    )


def _known_at(location: Sequence[int | str]) -> tuple[type[Section], str]:
    """Find the innermost section on the way to a location, and the description of the field that leads there."""
    section: type[Section] = Scenario
    note = ""
    top = ""
    tag = ""
    for part in location:
        if not isinstance(part, str):
            continue
        if part.startswith("="):
            section, tag = _alternative(top, part, section), part
            continue
        field = _fields(section).get(part)
        note = (field.description or "") if field else ""
        if section is Scenario:
            top = part
            section = _SECTIONS.get(part, Scenario)
        elif top == "faults" and field:
            section = _OF_FAULTS.get(part, section)
        elif top == "terrain" and part == "graph":
            section = GraphSpec
        elif part == "options":
            section = _OPTIONS.get(tag, section)
        elif top == "radio":
            section = _OF_RADIO.get(part, section)
    return section, note


def _alternative(top: str, tag: str, section: type[Section]) -> type[Section]:
    """Return the section behind one of a field's alternatives."""
    if top == "robots" and tag in ("=mapping", "=list"):
        return RobotGroup if tag == "=mapping" else RobotEntry
    if top == "faults" and section is Fault:
        return KINDS.get(tag.removeprefix("="), section)
    return section


def _unknown_key(key: str, section: type[Section]) -> str:
    if key == "commitment" and issubclass(section, PatrolSpec):
        return f"is target or none in files of 0.2; since then set patrol.policy to {DEFAULT} or {PAPER}"
    for options, policy in ((StochasticOptions, STOCHASTIC), (CommittedOptions, COMMITTED)):
        if section is options and key in PotentialFieldOptions.model_fields:
            return f"does nothing for the policy {policy}; leave it out, or set patrol.policy to {PAPER}"
    if section is CommittedOptions and key in StochasticOptions.model_fields:
        return f"does nothing for the policy {COMMITTED}, which is the tour; set patrol.policy to {STOCHASTIC}"
    return f"unknown key; {_nearest_key(key, section)}"


def _nearest_key(key: str, section: type[Section]) -> str:
    """Find the nearest known key, of this section or with the section that it belongs under; or this section's."""
    if (meant := MEANT.get(key.lower())) in _keys(section):
        return f"did you mean {meant}?"
    everywhere: list[tuple[str, type[Section]]] = [
        ("robots", RobotGroup),
        *_SECTIONS.items(),
        ("patrol.options", PotentialFieldOptions),
        *(("radio.options", options) for options in MODEL_OPTIONS.values()),
        *((f"radio.{name}", other_section) for name, other_section in _OF_RADIO.items()),
        ("", Scenario),
    ]
    spelled = {
        name: f"{home}.{name}" if home else f"{name} at the top level"
        for home, other_section in everywhere
        for name in _keys(other_section)
    }
    spelled |= {name: name for name in _keys(section)}
    near = get_close_matches(key.lower(), spelled, n=1, cutoff=0.6)
    return f"did you mean {spelled[near[0]]}?" if near else did_you_mean(key, _keys(section))


def _keys(section: type[Section]) -> list[str]:
    return list(_fields(section))


def _fields(section: type[Section]) -> dict[str, FieldInfo]:
    """Return a section's fields by the names that a file uses."""
    return {field.alias or name: field for name, field in section.model_fields.items()}
