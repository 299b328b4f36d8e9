"""The errors of a scenario, in one line that a person can act on."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from typing import Annotated, Any, get_args, get_origin

from pydantic import Tag, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from patrol.errors import BadInput, NotPrepared, did_you_mean, quoted
from patrol.scenario.model import Scenario
from patrol.scenario.policies import (
    COMMITTED,
    DEFAULT,
    PAPER,
    RANDOM_FOR,
    STOCHASTIC,
    TOUR_STATED,
    CommittedOptions,
    PatrolSpec,
    PotentialFieldOptions,
    StochasticOptions,
)
from patrol.scenario.radio_spec import AdaptiveSpec, BudgetSpec, PathLossOptions
from patrol.scenario.sections import RobotGroup
from patrol.values import BUILTINS, Section

MEANT = {"time": "at", "begin": "at", "start": "at", "duration": "for", "robot": "who", "robots": "who"}
"""What people call some keys of faults."""

GONE = {
    "commitment": f"patrol.policy to {DEFAULT} or {PAPER}",
    **{name: f"patrol.options.{name}" for name in PotentialFieldOptions.model_fields},
}
"""Settings that stood in the section `patrol` before 1.0, and what took their place."""


def _section_alternatives(annotation: Any, tag: str = "") -> Iterator[tuple[str, type[Section]]]:
    """Yield the sections that a field of some type may hold, each with its tag, such as ``=list``."""
    if get_origin(annotation) is Annotated:
        annotation, *notes = get_args(annotation)
        tag = next((note.tag for note in notes if isinstance(note, Tag)), tag)
    if isinstance(annotation, type) and issubclass(annotation, Section):
        yield tag, annotation
    for part in get_args(annotation):
        yield from _section_alternatives(part, tag)


def _section_of(field: FieldInfo) -> type[Section] | None:
    """Return what all sections that a field may hold have in common; None for a field that holds none."""
    sections = [section for _, section in _section_alternatives(field.annotation)]
    if not sections:
        return None
    return next(base for base in sections[0].mro() if all(issubclass(section, base) for section in sections))


SECTIONS: Mapping[str, type[Section]] = {
    name: section for name, field in Scenario.model_fields.items() if (section := _section_of(field)) is not None
}
"""The scenario's sections by name, of lists what an entry is."""

_UNKNOWN = ("extra_forbidden", "invalid_key")


LineOf = Callable[[Sequence[int | str]], int | None]
"""Path of keys and indices -> the line of the source where it stands, None when it does not."""


def one_line(
    error: ValidationError, source: str, overridden: Collection[str], line_of: LineOf, aliases: Mapping[str, str]
) -> str:
    """Write the first problem as ``source: line 3: field = value: problem``, and count the others.

    Keys that are gone come first, then unknown ones. `source` is the file, or what a mapping is called. `overridden`
    has the dotted fields that were given as overrides and not by the source; `aliases` is what to call a field instead
    of its dotted name.
    """
    problems = sorted(error.errors(include_url=False), key=_rank_problem)
    line = _describe_problem(problems[0], source, overridden, line_of, aliases)
    extra = len(problems) - 1
    return f"{line} (and {extra} more {'problem' if extra == 1 else 'problems'})" if extra else line


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


def _rank_problem(problem: ErrorDetails) -> int:
    if problem["type"] not in _UNKNOWN:
        return 2
    return 0 if _gone_key(str(problem["loc"][-1]), _known_at(problem["loc"])[0]) else 1


def _describe_problem(
    problem: ErrorDetails, source: str, overridden: Collection[str], line_of: LineOf, aliases: Mapping[str, str]
) -> str:
    context = problem.get("ctx", {})
    location = _locate_problem(problem)
    if problem["type"] == "crossed" and context["field"]:
        location += [int(part) if part.isdecimal() else part for part in context["field"].split(".")]
    field = ".".join(str(part) for part in location)
    if _is_overridden(field, overridden):
        where = f"override {field}"
    else:
        line = line_of(location)
        field = _field_name(field, aliases)
        where = f"{source}: {field}" if line is None else f"{source}: line {line}: {field}"
    section, note = _known_at(problem["loc"])
    match problem["type"]:
        case "extra_forbidden" | "invalid_key":
            key, in_list = str(location[-1]), any(isinstance(part, int) for part in location)
            return f"{where}: {_gone_key(key, section) or f'unknown key; {_nearest_key(key, section, in_list)}'}"
        case "missing":
            return f"{where}: missing; give {note or 'it'}"
        case "crossed":
            return f"{where}{context['value']}: {context['problem']}"
    expected = _expected_text(problem, section)
    if note and (context.get("bare") or problem["type"] == "tuple_type"):
        expected = f"{expected} ({note})"
    return f"{where} = {quoted(problem['input'])}: {expected}"


def _locate_problem(problem: ErrorDetails) -> list[int | str]:
    """Locate a problem, without the names of kinds (``=kill``), which stand for no key; a key may look like one."""
    location = problem["loc"]
    keys = [part for part in location if not str(part).startswith("=")]
    if problem["type"] in ("extra_forbidden", "invalid_key") and keys[-1:] != [location[-1]]:
        keys.append(location[-1])
    return keys


def _expected_text(problem: ErrorDetails, section: type[Section]) -> str:
    context = problem.get("ctx", {})
    match problem["type"]:
        case "expected":
            return f"expected {context['what']}"
        case "literal_error":
            allowed = context["expected"].replace("'", "")
            near = get_close_matches(str(problem["input"]).lower(), re.split(r", | or ", allowed), n=1, cutoff=0.6)
            return f"expected {allowed}{f'; did you mean {near[0]}?' if near else ''}"
        case "model_type":
            return f"expected keys and values ({', '.join(_section_keys(section))})"
        case "too_long":
            return f"expected at most {context['max_length']} of them"
        case "tuple_type":
            return "expected a list"
        case _:
            return problem["msg"]


def _field_name(field: str, aliases: Mapping[str, str]) -> str:
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
    alternatives: dict[str, type[Section]] = {}
    note = ""
    for part in location:
        if not isinstance(part, str):
            continue
        if part.startswith("="):
            section = alternatives.get(part, section)
            continue
        field = _section_fields(section).get(part)
        note = (field.description or "") if field else ""
        alternatives = dict(_section_alternatives(field.annotation)) if field else {}
        section = (field and _section_of(field)) or section
    return section, note


def _gone_key(key: str, section: type[Section]) -> str:
    """Return what took the place of a key that is gone, or has no effect here; empty for any other."""
    if section is SECTIONS["zones"] and key == "one_way":
        return "one-way zones are gone; drop it, or keep robots out with keep_out"
    if issubclass(section, PatrolSpec) and key in GONE:
        return f"is no setting of patrol; set {GONE[key]}"
    if section is CommittedOptions and key in TOUR_STATED:
        return f"is gone: {COMMITTED} is the tour alone; drop it, or set patrol.policy to {STOCHASTIC}"
    if section is PotentialFieldOptions and key in RANDOM_FOR:
        return "is gone: each robot makes random steps; drop it, or set random_move to 0"
    for options, policy in ((StochasticOptions, STOCHASTIC), (CommittedOptions, COMMITTED)):
        if section is options and key in PotentialFieldOptions.model_fields:
            return f"does nothing for the policy {policy}; leave it out, or set patrol.policy to {PAPER}"
    return ""


def _nearest_key(key: str, section: type[Section], in_list: bool) -> str:
    """Find the nearest known key, of this section or with the section that it belongs under; or this section's.

    Only this section's for an entry of a list.
    """
    if (meant := MEANT.get(key.lower())) in _section_keys(section):
        return f"did you mean {meant}?"
    if in_list:
        return did_you_mean(key, _section_keys(section))
    everywhere: dict[str, type[Section]] = {
        **SECTIONS,
        "robots": RobotGroup,
        "patrol.options": PotentialFieldOptions,
        "radio.options": PathLossOptions,
        "radio.budget": BudgetSpec,
        "radio.adaptive": AdaptiveSpec,
        "": Scenario,
    }
    spelled = {
        name: f"{home}.{name}" if home else f"{name} at the top level"
        for home, other_section in everywhere.items()
        for name in _section_keys(other_section)
    }
    spelled |= {name: name for name in _section_keys(section)}
    near = get_close_matches(key.lower(), spelled, n=1, cutoff=0.6)
    return f"did you mean {spelled[near[0]]}?" if near else did_you_mean(key, _section_keys(section))


def _section_keys(section: type[Section]) -> list[str]:
    return list(_section_fields(section))


def _section_fields(section: type[Section]) -> dict[str, FieldInfo]:
    """Return a section's fields by the names that a file uses."""
    return {field.alias or name: field for name, field in section.model_fields.items()}
