"""The plan of a sweep: a base scenario, the cases that vary it, and the seeds that each case is run with.

A sweep file is YAML::

    base: yards-five.yaml            # a scenario file, or the keys and values of a scenario
    grid:                            # every combination of these values is a case
      patrol.options.dilatation: [0, 2, 5]
      robots.count: [1, 3]
    cases:                           # named cases; together with a grid, each case is run on the whole grid
      - {name: mode, set: {patrol.options.direction: mode}}
      - {name: vector, set: {patrol.options.direction: vector}}
    seeds: 3                         # seeds 1 to 3, or a list of seeds (default: the base scenario's seed)
    against: {patrol.options.dilatation: 0}  # compare each case, seed by seed, with the case that differs only in this
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from dataclasses import field as default
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

from patrol.errors import BadInput, did_you_mean, quoted
from patrol.files.untrusted import SWEEP
from patrol.files.yaml_text import line_of, parse_yaml, read_text
from patrol.scenario import Scenario, load_scenario, scenario_hash
from patrol.scenario.file.load import check_map

MAX_RUNS = 100_000
"""Limit of the runs in a sweep."""

_KEYS = ("name", "base", "grid", "cases", "seeds", "against")
_CASE_KEYS = ("name", "set")


@dataclass(frozen=True, slots=True)
class Case:
    """A variation of the base scenario.

    Attributes:
        name: The case's name.
        settings: What it sets in the base scenario: values by dotted field.
    """

    name: str
    settings: Mapping[str, object]


@dataclass(frozen=True, slots=True)
class Run:
    """One run to make.

    Attributes:
        key: SHA-256 (hex) of the meaning of the resolved scenario, its seed included.
        case: Name of its case.
        seed: Its seed.
        scenario: The resolved scenario.
        settings: What its case sets in the base scenario: values by dotted field.
        games: Whether intruder games are played on it.
    """

    key: str
    case: str
    seed: int
    scenario: Scenario
    settings: Mapping[str, object] = default(default_factory=dict)
    games: bool = False


@dataclass(frozen=True, slots=True)
class Plan:
    """All runs of a sweep. Runs of different cases that mean the same have the same key.

    Attributes:
        name: The sweep's name.
        cases: The cases.
        seeds: The seeds that each case is run with.
        runs: The runs, case by case.
        partners: For each case that is compared with another one, the name of that one.
    """

    name: str
    cases: tuple[Case, ...]
    seeds: tuple[int, ...]
    runs: tuple[Run, ...]
    partners: Mapping[str, str] = default(default_factory=dict)

    def runs_of(self, case: str) -> list[Run]:
        """Return the runs of a case, one per seed.

        Args:
            case: Name of the case.
        """
        return [run for run in self.runs if run.case == case]

    def partner(self, case: Case) -> Case | None:
        """Return the case that another is compared with.

        Args:
            case: The case to compare.

        Returns:
            The case that differs only in the settings of `against`; None if there is none, or `case` has them itself.
        """
        name = self.partners.get(case.name)
        return next((other for other in self.cases if other.name == name), None)


@dataclass(frozen=True, slots=True)
class Base:
    """A scenario to vary, not yet checked.

    Attributes:
        raw: The scenario's keys and values.
        folder: The folder that its relative paths begin at.
        called: What errors call it.
    """

    raw: Mapping[str, Any]
    folder: Path
    called: str


def make_plan(
    name: str, base: Base, cases: Iterable[Case], seeds: Sequence[int], against: Mapping[str, object] | None = None
) -> Plan:
    """Make a plan: resolve and check all its runs.

    Args:
        name: The sweep's name.
        base: The scenario to vary.
        cases: The cases.
        seeds: The seeds that each case is run with.
        against: Settings of the cases that others are compared with.

    Returns:
        The plan.

    Raises:
        BadInput: There are too many runs, or a case is wrong; the message names it.
    """
    cases = tuple(cases)
    _names_differ(cases, base.called)
    if len(cases) * len(seeds) > MAX_RUNS:
        raise BadInput(f"{base.called}: {len(cases)} cases x {len(seeds)} seeds; a sweep has at most {MAX_RUNS} runs")
    runs = [_run(base, case, seed) for case in cases for seed in seeds]
    partners = _partners(base, cases, runs[:: len(seeds)], against) if against else {}
    return Plan(name, cases, tuple(seeds), tuple(runs), partners)


def read_plan(path: Path, seeds: int | None = None) -> Plan:
    """Read a sweep file.

    Args:
        path: The file.
        seeds: Use seeds 1 to this number instead of the file's; None for the file's.

    Returns:
        The plan.

    Raises:
        BadInput: The file cannot be read, or something in it is wrong.
    """
    return plan_of(parse_yaml(read_text(path, SWEEP), str(path)), path, seeds)


def plan_of(raw: object, path: Path, seeds: int | None = None) -> Plan:
    """Make a plan of what a sweep file holds.

    Args:
        raw: The content: keys and values.
        path: The file, for errors and for paths relative to it; it need not exist.
        seeds: As for `read_plan`.

    Returns:
        The plan.

    Raises:
        BadInput: Something in it is wrong.
    """
    if not isinstance(raw, dict) or "base" not in raw:
        raise BadInput(f"{path}: is no sweep; give 'base:', a scenario or its file, and 'grid:', 'cases:' or 'seeds:'")
    for key in raw:
        if key not in _KEYS:
            raise BadInput(f"{path}: {key}: unknown key; {did_you_mean(str(key), _KEYS)}")
    base = _base(raw["base"], path)
    name = raw.get("name", path.stem)
    if not isinstance(name, str) or not name or not name.isprintable():
        raise BadInput(f"{path}: name = {quoted(name)}: expected text without control characters")
    numbers = count_of_seeds(seeds, "--seeds") if seeds is not None else _seeds(raw.get("seeds"), base, path)
    against = raw.get("against")
    if not (
        against is None or (isinstance(against, dict) and against and all(isinstance(key, str) for key in against))
    ):
        raise BadInput(f"{path}: against = {quoted(against)}: expected {{FIELD: VALUE, ...}}")
    return make_plan(name, base, _cases(raw, path), numbers, against)


def count_of_seeds(count: int, called: str) -> tuple[int, ...]:
    """Return the seeds 1 to `count`.

    Args:
        count: Number of seeds.
        called: What errors call the number.

    Raises:
        BadInput: The number is out of range.
    """
    if not 1 <= count <= MAX_RUNS:
        raise BadInput(f"{called} = {count}: expected a whole number from 1 to {MAX_RUNS}")
    return tuple(range(1, count + 1))


def _run(base: Base, case: Case, seed: int) -> Run:
    if "seed" in case.settings:
        raise BadInput(f"{base.called}: case {case.name}: sets seed; give the seeds under 'seeds:'")
    try:
        scenario = load_scenario(base.raw, {**case.settings, "seed": seed}, base=base.folder, called=base.called)
        check_map(scenario, base.called)
        return Run(scenario_hash(scenario), case.name, seed, scenario, case.settings)
    except BadInput as error:
        where = f"{base.called}: case {case.name}" if case.settings else base.called
        raise BadInput(f"{where}: {str(error).removeprefix(f'{base.called}: ')}") from None


def _partners(base: Base, cases: Sequence[Case], runs: Sequence[Run], against: Mapping[str, object]) -> dict[str, str]:
    """For each case the one whose scenario is the same but for `against`: what results counts, not what is stated.

    For example {set: {}} and {set: {patrol.options.dilatation: 2}} are the same case where 2 is the base's dilatation.

    Args:
        base: The scenario to vary.
        cases: The cases.
        runs: A run of each case, all with one seed.
        against: Settings of the cases that others are compared with.
    """
    called = {run.key: run.case for run in reversed(runs)}
    partners: dict[str, str] = {}
    refused: BadInput | None = None
    for case, run in zip(cases, runs, strict=True):
        try:
            wanted = _run(base, Case(f"{case.name} against {quoted(against)}", {**case.settings, **against}), run.seed)
        except BadInput as error:
            refused = error
            continue
        if wanted.key != run.key and wanted.key in called:
            partners[case.name] = called[wanted.key]
    if not partners:
        if refused is not None:
            raise refused
        raise BadInput(
            f"{base.called}: against = {quoted(against)}: no two cases differ only in that; vary it in the grid"
        )
    return partners


def _base(given: object, path: Path) -> Base:
    if isinstance(given, dict):
        return Base({"name": path.stem, **given}, path.parent, f"{path}: base")
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
    return Base({"name": file.stem, **raw}, file.parent, str(file))


def _seeds(given: object, base: Base, path: Path) -> tuple[int, ...]:
    if given is None:
        given = [load_scenario(base.raw, base=base.folder, called=base.called).seed]
    if isinstance(given, int) and not isinstance(given, bool):
        return count_of_seeds(given, f"{path}: seeds")
    if isinstance(given, list) and given and all(type(seed) is int and seed >= 0 for seed in given):
        twice = [seed for seed, count in Counter(given).items() if count > 1]
        if not twice:
            return tuple(given)
        raise BadInput(f"{path}: seeds: {twice[0]} occurs twice; give each seed once")
    raise BadInput(f"{path}: seeds = {quoted(given)}: expected a count such as 3, or a list of seeds such as [1, 2, 3]")


def _cases(raw: Mapping[str, Any], path: Path) -> list[Case]:
    named = list(_named(raw.get("cases"), path))
    grid = _grid(raw.get("grid"), path)
    count = len(named) * prod(len(values) for values in grid.values())
    if count > MAX_RUNS:
        raise BadInput(f"{path}: grid: makes {count} cases; a sweep has at most {MAX_RUNS} runs")
    short = _short_names(list(grid))
    cases = []
    for case, values in product(named, product(*grid.values())):
        chosen = dict(zip(grid, values, strict=True))
        for field in case.settings:
            if field in chosen:
                raise BadInput(f"{path}: {field}: is set by case {case.name} and by the grid; set it in one of them")
        parts = [case.name, *(f"{short[field]}={_plain(value)}" for field, value in chosen.items())]
        cases.append(Case(" ".join(part for part in parts if part), {**case.settings, **chosen}))
    return [Case("base", {})] if [case.name for case in cases] == [""] else cases


def _named(given: object, path: Path) -> Iterator[Case]:
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
        yield Case(entry["name"], settings)


def _grid(given: object, path: Path) -> dict[str, list[object]]:
    if given is None:
        return {}
    if not isinstance(given, dict):
        raise BadInput(f"{path}: grid = {quoted(given)}: expected {{FIELD: [VALUE, ...], ...}}")
    for field, values in given.items():
        if not isinstance(field, str):
            raise BadInput(f"{path}: grid: {quoted(field)}: expected a field such as patrol.options.dilatation")
        if not isinstance(values, list) or not values:
            raise BadInput(f"{path}: grid.{field} = {quoted(values)}: expected a list of values such as [0, 2, 5]")
    return given


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


def _plain(value: object) -> str:
    return value if isinstance(value, str) else quoted(value)
