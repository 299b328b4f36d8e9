"""Arguments of the functions that notebooks call: errors of one line, plain numbers, and classes of policies by name.

A class of a module is ``package.module:Class``, which every process can import. A module beside the script is named by
its file, since other processes do not look into the script's folder. A notebook's or a script's own class is
``__main__:Class``, which only the process that defined it can find.
"""

from __future__ import annotations

import inspect
import os
import sys
from collections.abc import Callable, Mapping
from functools import wraps
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from patrol.errors import BadInput, did_you_mean, quoted
from patrol.scenario import Scenario, changed_scenario, load_scenario, open_scenario


def scenario_of(
    scenario: Scenario | Mapping[str, Any] | str | Path, overrides: Mapping[str, object] | None = None
) -> Scenario:
    """Load a scenario, with overrides by dotted field.

    It may be a scenario file, a map's YAML file, the name of a built-in terrain, a mapping shaped like a scenario file,
    or a loaded scenario.
    """
    if isinstance(scenario, Scenario):
        return changed_scenario(scenario, overrides or {})
    if isinstance(scenario, Mapping):
        return load_scenario(scenario, overrides)
    return open_scenario(str(scenario), overrides)


P = ParamSpec("P")
T = TypeVar("T")

MAPPINGS = {
    "overrides": "values by dotted field, such as {'duration': 60}",
    "grid": "lists of values by dotted field, such as {'robots.count': [1, 3]}",
    "cases": "settings by the name of a case, such as {'blind': {'sensor.range': 2}}",
    "against": "values by dotted field, such as {'robots.count': 1}",
}
"""The arguments that are mappings, and what they hold."""

FOLDERS = ("out", "folder")

_OF_ROBOTS = ("count", "model", "radius", "speed", "starts")
FIELDS = {"robots": "robots.count", **{name: f"robots.{name}" for name in _OF_ROBOTS}}
"""Fields that have another name as an option of the command."""


class WrongArguments(BadInput, TypeError):
    """Arguments that a function does not take. Gymnasium's users catch a TypeError to try again without them."""


def checked_arguments(function: Callable[P, T]) -> Callable[P, T]:
    """Return a function that checks its arguments before it runs, and replaces NumPy's values in them.

    For example, ``fogwatch.run("yards", duration=10)`` says that a field of the scenario is given in ``overrides``. The
    function returned raises BadInput, or WrongArguments where it does not take these arguments.
    """
    signature = inspect.signature(function)

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> T:
        name = function.__name__
        try:
            bound = signature.bind(*args, **kwargs)
        except TypeError as error:
            unknown = [argument for argument in kwargs if argument not in signature.parameters]
            if unknown:
                raise _no_argument(name, unknown[0], kwargs[unknown[0]], signature) from None
            raise WrongArguments(f"{name}(): {error}; help({name}) explains every argument") from None
        for argument, value in bound.arguments.items():
            bound.arguments[argument] = plain(value)
            if argument in MAPPINGS and value is not None:
                _check_mapping(argument, value)
            if argument == "progress" and value is not None and not callable(value):
                raise BadInput(f"progress = {quoted(plain(value))}: expected a function, such as print")
            if argument in FOLDERS and not isinstance(value, str | os.PathLike | None):
                raise BadInput(f"{argument} = {quoted(value)}: expected a folder, such as 'runs/first'")
        return function(*bound.args, **bound.kwargs)

    return checked


def plain(value: object) -> object:
    """Return a value with Python's own numbers and lists in place of those of NumPy, pandas and the like.

    Mappings, lists, tuples and ranges are copied.
    """
    if isinstance(value, Mapping):
        return {plain(key): plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple | range):
        return [plain(inner) for inner in value]
    to_list = getattr(value, "tolist", None)
    return to_list() if callable(to_list) and not isinstance(value, type) else value


def _check_mapping(argument: str, value: object) -> None:
    expected = f"expected {MAPPINGS[argument]}"
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise BadInput(f"{argument} = {quoted(value)}: {expected}")
    if argument == "cases":
        for case, settings in value.items():
            if not isinstance(settings, Mapping):
                raise BadInput(f"cases: {case} = {quoted(settings)}: {expected}")


def _no_argument(function: str, argument: str, value: object, signature: inspect.Signature) -> WrongArguments:
    field = FIELDS.get(argument, argument)
    ways = {"overrides": f"{{{field!r}: {value!r}}}", "grid": f"{{{field!r}: [{value!r}]}}"}
    way = next((f"{name}={instead}" for name, instead in ways.items() if name in signature.parameters), None)
    if way is not None and field.partition(".")[0] in Scenario.model_fields:
        remedy = f"a field of the scenario is given as {way}"
    else:
        remedy = did_you_mean(argument, list(signature.parameters))
    return WrongArguments(f"{argument} = {quoted(plain(value))}: {function}() has no such argument; {remedy}")


MAIN = "__main__"


def policy_name(policy: type[Any], *, in_process: bool) -> str:
    """Return the name of a policy class for ``patrol.policy``.

    Unless it is only used `in_process`, other processes must be able to import it.
    """
    if not isinstance(policy, type):
        raise BadInput(f"policy = {policy!r}: expected a class; give a name as overrides={{'patrol.policy': NAME}}")
    module, name = policy.__module__, policy.__qualname__
    if not callable(getattr(policy, "decide", None)):
        raise BadInput(f"policy = {name}: has no method decide(view); see docs/policies.md")
    if getattr(sys.modules.get(module), name, None) is not policy:
        raise BadInput(f"policy = {name}: is not at the top level of its module {module}; define it there")
    if module == MAIN and not in_process:
        raise BadInput(
            f"policy = {name}: was defined here, where other processes cannot import it; run with in_process=True, or "
            f"put it into a file and give overrides={{'patrol.policy': './file.py:{name}'}}"
        )
    file = getattr(sys.modules[module], "__file__", None)
    if not in_process and file is not None and Path(file).parent in (Path(sys.path[0]).absolute(), Path.cwd()):
        return f"{file}:{name}"
    return f"{module}:{name}"


def with_names(settings: Mapping[str, object]) -> dict[str, object]:
    """Replace policy classes among settings for other processes by their names.

    Settings are values by dotted field; a value may be a list of values, each alone or with a label.
    """

    def named(value: object) -> object:
        if isinstance(value, list | tuple | range):
            return [named(entry) for entry in value]
        if isinstance(value, dict) and "label" in value:
            return {key: named(part) for key, part in value.items()}
        return policy_name(value, in_process=False) if isinstance(value, type) else value

    return {field: named(value) for field, value in settings.items()}
