"""The plan of a sweep: a base scenario, the cases that vary it, and the seeds that each case is run with.

A sweep file is YAML::

    base: yards-five.yaml            # a scenario file, or the keys and values of a scenario
    grid:                            # every combination of these values is a case
      patrol.options.dilatation: [0, 2, 5]
      faults: [{label: quiet, value: []}, {label: half lost, value: [{kind: loss, rate: 0.5}]}]
    cases:                           # named cases; together with a grid, each case is run on the whole grid
      - {name: mode, set: {patrol.options.direction: mode}}
      - {name: vector, set: {patrol.options.direction: vector}}
    seeds: 3                         # seeds 1 to 3, or a list of seeds (default: the base scenario's seed)
    against: {patrol.options.dilatation: 0}  # compare each case, seed by seed, with the case that differs only in this
                                     # {case: mode}: with the named case on the same grid values
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from dataclasses import field as default
from difflib import get_close_matches
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

from patrol.errors import BadInput, did_you_mean, quoted
from patrol.files.untrusted import SWEEP
from patrol.files.yaml_text import line_of, parse_yaml, read_text
from patrol.scenario import Scenario, load_scenario, scenario_hash
from patrol.scenario.load import check_map

MAX_RUNS = 100_000
"""Limit of the runs in a sweep."""

_KEYS = ("name", "base", "grid", "cases", "seeds", "against")
_CASE_KEYS = ("name", "set")
_VALUE_KEYS = {"label", "value"}

CASE = "case"
"""The axis of the named cases; other axes are fields of the grid."""


@dataclass(frozen=True, slots=True)
class Label:
    """The name of a case's value on one axis of a sweep."""

    axis: str  # dotted field of the grid, or `CASE`
    title: str  # shortest name of the axis: the field's last part where no other field of the grid ends alike
    text: str  # name of the value: the sweep's label, or the value as text
    given: bool  # True if the sweep gives the name itself

    @property
    def word(self) -> str:
        """The axis's part of the case's name, such as "half lost" or "dilatation=2"."""
        return self.text if self.given else f"{self.title}={self.text}"


@dataclass(frozen=True, slots=True)
class Case:
    """A variation of the base scenario."""

    name: str
    settings: Mapping[str, object]  # of the base scenario, by dotted field
    labels: tuple[Label, ...] = ()  # its values by axis, in the order of its name; empty where the sweep has no axes


@dataclass(frozen=True, slots=True)
class Run:
    """One run to make."""

    key: str  # SHA-256 (hex) of the meaning of the resolved scenario, its seed included
    case: str  # its name
    seed: int
    scenario: Scenario  # resolved
    # what its case sets in the base scenario, by dotted field
    settings: Mapping[str, object] = default(default_factory=dict)
    games: bool = False  # True if intruder games are played on it


@dataclass(frozen=True, slots=True)
class Plan:
    """All runs of a sweep. Runs of different cases that mean the same have the same key."""

    name: str
    cases: tuple[Case, ...]
    seeds: tuple[int, ...]  # each case is run with all of them
    runs: tuple[Run, ...]  # case by case
    # name of the case that a case is compared with, by name; only where there is another
    partners: Mapping[str, str] = default(default_factory=dict)
    unpaired: tuple[str, ...] = ()  # names of cases for which `against` names a case that the sweep does not have

    @property
    def notes(self) -> list[str]:
        """A line for each case without a partner, for people."""
        why = "no other case differs from it in what `against` sets and in nothing else"
        return [f"no partner: {case}: {why}" for case in self.unpaired]

    def runs_of(self, case: str) -> list[Run]:
        """Return the runs of a case, one per seed."""
        return [run for run in self.runs if run.case == case]

    def partner(self, case: Case) -> Case | None:
        """Return the case that `against` names for another; None if there is none, or it is that case itself."""
        name = self.partners.get(case.name)
        return next((candidate for candidate in self.cases if candidate.name == name), None)


@dataclass(frozen=True, slots=True)
class Base:
    """A scenario to vary, not yet checked."""

    raw: Mapping[str, Any]  # keys and values
    folder: Path  # where its relative paths begin
    called: str  # what errors call the sweep
    source: str | None = None  # what errors call the scenario; None for the same


def make_plan(
    name: str, base: Base, cases: Iterable[Case], seeds: Sequence[int], against: Mapping[str, object] | None = None
) -> Plan:
    """Make a plan: resolve and check all its runs.

    `against` has settings of the cases that others are compared with, or the name of a case under `CASE`.
    """
    cases = tuple(cases)
    _names_differ(cases, base.called)
    if len(cases) * len(seeds) > MAX_RUNS:
        raise BadInput(f"{base.called}: {len(cases)} cases x {len(seeds)} seeds; a sweep has at most {MAX_RUNS} runs")
    runs = [_make_run(base, case, seed) for case in cases for seed in seeds]
    if not against:
        return Plan(name, cases, tuple(seeds), tuple(runs))
    if CASE in against:
        return Plan(name, cases, tuple(seeds), tuple(runs), _named_partners(base, cases, against))
    partners, unpaired = _pair_cases(base, cases, runs[:: len(seeds)], against)
    return Plan(name, cases, tuple(seeds), tuple(runs), partners, unpaired)


def read_plan(path: Path, seeds: int | None = None) -> Plan:
    """Read a sweep file; `seeds` uses seeds 1 to this number instead of the file's."""
    return plan_of(parse_yaml(read_text(path, SWEEP), str(path)), path, seeds)


def plan_of(raw: object, path: Path, seeds: int | None = None) -> Plan:
    """Make a plan of the content of a sweep file; `seeds` is as for `read_plan`.

    `path` is the file, for errors and for paths relative to it; it need not exist.
    """
    if not isinstance(raw, dict) or "base" not in raw:
        raise BadInput(f"{path}: is no sweep; give 'base:', a scenario or its file, and 'grid:', 'cases:' or 'seeds:'")
    for key in raw:
        if key not in _KEYS:
            raise BadInput(f"{path}: {key}: unknown key; {did_you_mean(str(key), _KEYS)}")
    base = _read_base(raw["base"], path)
    name = raw.get("name", path.stem)
    if not isinstance(name, str) or not name or not name.isprintable():
        raise BadInput(f"{path}: name = {quoted(name)}: expected text without control characters")
    numbers = count_of_seeds(seeds) if seeds is not None else _read_seeds(raw.get("seeds"), base, path)
    against = raw.get("against")
    if not (
        against is None or (isinstance(against, dict) and against and all(isinstance(key, str) for key in against))
    ):
        raise BadInput(f"{path}: against = {quoted(against)}: expected {{FIELD: VALUE, ...}} or {{case: NAME}}")
    grid = _read_grid(raw.get("grid"), path)
    if against is not None:
        against = {field: _value_of(value, grid.get(field, ())) for field, value in against.items()}
    return make_plan(name, base, _read_cases(raw, grid, path), numbers, against)


def count_of_seeds(count: int, called: str = "seeds") -> tuple[int, ...]:
    """Return the seeds 1 to `count`."""
    if not 1 <= count <= MAX_RUNS:
        raise BadInput(f"{called} = {count}: expected a whole number from 1 to {MAX_RUNS}")
    return tuple(range(1, count + 1))


def _make_run(base: Base, case: Case, seed: int) -> Run:
    if "seed" in case.settings:
        raise BadInput(f"{base.called}: case {case.name}: sets seed; give the seeds under 'seeds:'")
    source = base.source or base.called
    try:
        scenario = load_scenario(base.raw, {**case.settings, "seed": seed}, base=base.folder, called=source)
        check_map(scenario, source)
        return Run(scenario_hash(scenario), case.name, seed, scenario, case.settings)
    except BadInput as error:
        problem = str(error).removeprefix(f"{source}: ")
        if case.settings:
            problem = f"case {case.name}: {problem}"
        overridden = problem.startswith(f"case {case.name}: override ")  # by the sweep
        raise BadInput(f"{base.called if overridden else source}: {problem}") from None


def _named_partners(base: Base, cases: Sequence[Case], against: Mapping[str, object]) -> dict[str, str]:
    """Pair each case with the named case on the same grid values, or with the one whose whole name this is."""
    wanted = against[CASE]
    where = f"{base.called}: against = {quoted(against)}"
    if len(against) > 1:
        raise BadInput(f"{where}: give either case: NAME or fields, not both")
    named = {label.text for case in cases for label in case.labels if label.axis == CASE}
    if wanted not in (choices := [*named, *(case.name for case in cases)]):
        raise BadInput(f"{where}: no such case; {did_you_mean(str(wanted), choices)}")
    by_labels = {case.labels: case.name for case in cases}
    partners = {}
    for case in cases:
        moved = tuple(replace(label, text=str(wanted)) if label.axis == CASE else label for label in case.labels)
        partner = by_labels[moved] if wanted in named else str(wanted)
        if partner != case.name:
            partners[case.name] = partner
    return partners


def _pair_cases(
    base: Base, cases: Sequence[Case], runs: Sequence[Run], against: Mapping[str, object]
) -> tuple[dict[str, str], tuple[str, ...]]:
    """Pair each case with the one whose scenario is the same but for `against`.

    The resulting scenarios count, not the settings: {set: {}} and {set: {patrol.options.dilatation: 2}} are the same
    case where 2 is the base's dilatation.

    `runs` has a run of each case, all with one seed. The result is the partners by the names of the cases, and the
    cases that have none and are no partners themselves.
    """
    called = {run.key: run.case for run in reversed(runs)}
    partners: dict[str, str] = {}
    unpaired = []
    refused: BadInput | None = None
    for case, run in zip(cases, runs, strict=True):
        try:
            wanted = _make_run(
                base, Case(f"{case.name} against {quoted(against)}", {**case.settings, **against}), run.seed
            )
        except BadInput as error:
            refused = error
            unpaired.append(case.name)
            continue
        if wanted.key not in called:
            unpaired.append(case.name)
        elif wanted.key != run.key:
            partners[case.name] = called[wanted.key]
    if not partners:
        where = f"{base.called}: against = {quoted(against)}"
        for field, value in against.items():
            choices = {_text_of(case, field): case.settings[field] for case in cases if field in case.settings}
            if choices and value not in choices.values():
                raise BadInput(f"{where}: no case has this {field}; {did_you_mean(_as_text(value), list(choices))}")
        if refused is not None:
            raise refused
        raise BadInput(f"{where}: no two cases differ only in that; vary it in the grid, or give case: NAME")
    return partners, tuple(unpaired)


def _text_of(case: Case, field: str) -> str:
    """Return the name of a case's value of a field that it sets."""
    return next((label.text for label in case.labels if label.axis == field), _as_text(case.settings[field]))


def _as_text(value: object) -> str:
    return value if isinstance(value, str) else quoted(value)


def _read_base(given: object, path: Path) -> Base:
    if isinstance(given, dict):
        return Base({"name": path.stem, **given}, path.parent, str(path), f"{path}: base")
    if not isinstance(given, str):
        raise BadInput(f"{path}: base = {quoted(given)}: expected a scenario's keys and values, or its file")
    file = path.parent / given
    if not os.path.exists(file):  # noqa: PTH110 - Path.exists raises for a name that is too long
        line = line_of(read_text(path, SWEEP), ("base",))
        raise BadInput(f"{path}: line {line}: base = {given}: no such file; a path is relative to the sweep's folder")
    raw = parse_yaml(read_text(file), str(file))
    if not isinstance(raw, dict):
        raise BadInput(
            f"{path}: base = {given}: that file holds no scenario; name one, such as examples/yards-five.yaml"
        )
    return Base({"name": file.stem, **raw}, file.parent, str(path), str(file))


def _read_seeds(seeds: object, base: Base, path: Path) -> tuple[int, ...]:
    if seeds is None:
        seeds = [load_scenario(base.raw, base=base.folder, called=base.source or base.called).seed]
    if isinstance(seeds, int) and not isinstance(seeds, bool):
        return count_of_seeds(seeds, f"{path}: seeds")
    if isinstance(seeds, list) and seeds and all(type(seed) is int and seed >= 0 for seed in seeds):
        twice = [seed for seed, count in Counter(seeds).items() if count > 1]
        if not twice:
            return tuple(seeds)
        raise BadInput(f"{path}: seeds: {twice[0]} occurs twice; give each seed once")
    raise BadInput(f"{path}: seeds = {quoted(seeds)}: expected a count such as 3, or a list of seeds such as [1, 2, 3]")


def _read_cases(raw: Mapping[str, Any], grid: Mapping[str, Sequence[_GridValue]], path: Path) -> list[Case]:
    named = list(_named_cases(raw.get("cases"), path))
    count = len(named) * prod(len(values) for values in grid.values())
    if count > MAX_RUNS:
        raise BadInput(f"{path}: grid: makes {count} cases; a sweep has at most {MAX_RUNS} runs")
    cases = []
    for case, values in product(named, product(*grid.values())):
        chosen = {choice.label.axis: choice.value for choice in values}
        for field in case.settings:
            if field in chosen:
                raise BadInput(f"{path}: {field}: is set by case {case.name} and by the grid; set it in one of them")
        labels = (*case.labels, *(choice.label for choice in values))
        cases.append(Case(" ".join(label.word for label in labels), {**case.settings, **chosen}, labels))
    return [Case("base", {})] if [case.name for case in cases] == [""] else cases


def _named_cases(given: object, path: Path) -> Iterator[Case]:
    """Yield the named cases; one without a name and settings where there are none."""
    if given is None:
        yield Case("", {})
        return
    if not isinstance(given, list) or not given:
        raise BadInput(f"{path}: cases = {quoted(given)}: expected a list such as [{{name: a, set: {{FIELD: VALUE}}}}]")
    for index, entry in enumerate(given):
        where = f"{path}: cases.{index}"
        if not isinstance(entry, dict) or not isinstance(entry.get("name"), str) or not entry["name"]:
            raise BadInput(f"{where} = {quoted(entry)}: expected {{name: NAME, set: {{FIELD: VALUE, ...}}}}")
        for key in entry:
            if key not in _CASE_KEYS:
                raise BadInput(f"{where}: {key}: unknown key; {did_you_mean(str(key), _CASE_KEYS)}")
        settings = entry.get("set") or {}
        if not isinstance(settings, dict) or not all(isinstance(field, str) for field in settings):
            raise BadInput(f"{where}.set = {quoted(settings)}: expected {{FIELD: VALUE, ...}}")
        yield Case(entry["name"], settings, (Label(CASE, CASE, entry["name"], given=True),))


@dataclass(frozen=True, slots=True)
class _GridValue:
    """A value of a field of the grid, and its name."""

    label: Label
    value: object


def _read_grid(given: object, path: Path) -> dict[str, list[_GridValue]]:
    if given is None:
        return {}
    if not isinstance(given, dict):
        raise BadInput(f"{path}: grid = {quoted(given)}: expected {{FIELD: [VALUE, ...], ...}}")
    for field, values in given.items():
        if not isinstance(field, str):
            raise BadInput(f"{path}: grid: {quoted(field)}: expected a field such as patrol.options.dilatation")
        if not isinstance(values, list) or not values:
            raise BadInput(f"{path}: grid.{field} = {quoted(values)}: expected a list of values such as [0, 2, 5]")
    titles = _short_names(list(given))
    return {
        field: [_grid_value(field, titles[field], value, f"{path}: grid.{field}.{i}") for i, value in enumerate(values)]
        for field, values in given.items()
    }


def _grid_value(field: str, title: str, given: object, where: str) -> _GridValue:
    """Read a value: as it is, or {label: NAME, value: VALUE}."""
    if not isinstance(given, dict) or "label" not in given:
        if isinstance(given, dict) and "value" in given and (wrong := get_close_matches("label", map(str, given))):
            raise BadInput(f"{where}: {wrong[0]}: unknown key; did you mean label?")
        return _GridValue(Label(field, title, _as_text(given), given=False), given)
    label = given["label"]
    if set(given) != _VALUE_KEYS or not isinstance(label, str) or not label.strip():
        raise BadInput(f"{where} = {quoted(given)}: expected {{label: NAME, value: VALUE}}, or a value alone")
    return _GridValue(Label(field, title, label, given=True), given["value"])


def _value_of(given: object, values: Sequence[_GridValue]) -> object:
    """Return the value of the grid that a label names; anything else is the value itself."""
    return next((choice.value for choice in values if choice.label.given and choice.label.text == given), given)


def _names_differ(cases: Sequence[Case], called: str) -> None:
    for name, count in Counter(case.name for case in cases).items():
        if count > 1:
            raise BadInput(f"{called}: case {name}: occurs {count} times; give each case another name and value")
        if not name.isprintable():
            raise BadInput(f"{called}: case {name}: has a control character; give it another name or value")


def _short_names(fields: Sequence[str]) -> dict[str, str]:
    """Return the last part of each dotted field where it is unique, otherwise the whole field."""
    last = Counter(field.rpartition(".")[2] for field in fields)
    return {field: tail if last[tail := field.rpartition(".")[2]] == 1 else field for field in fields}
