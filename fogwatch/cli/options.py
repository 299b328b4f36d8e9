"""Options, each declared once: for the command line, its help and its errors, and for Python.

A parameter of a command is declared as ``radius: Annotated[float | None, option("M", "Body radius in m.")] = None``.
Options that several commands take, or that Python takes too, are fields of a dataclass, declared in the same way: a
command with a parameter of that class has all of its options, and gets one value (`spread`).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from inspect import Parameter, Signature, signature
from typing import Annotated, Any, get_origin, get_type_hints

import typer

from patrol.errors import BadInput

FIELDS = {
    "robots": "robots.count",
    "spare": "robots.spare",
    "model": "robots.model",
    "radius": "robots.radius",
    "speed": "robots.speed",
    "turning_radius": "robots.turning_radius",
    "start": "robots.starts",
    "duration": "duration",
    "seed": "seed",
    "pace": "pace",
    "point": "point",
    "sensor_range": "sensor.range",
    "terrain": "terrain.builtin",
}
"""The scenario's fields that options set, by the names of the options' parameters."""


def argument(metavar: str, text: str) -> Any:
    """Return what makes a parameter an argument."""
    return typer.Argument(metavar=metavar, help=text)


def option(metavar: str, text: str, *names: str, panel: str | None = None, **more: Any) -> Any:
    """Return what makes a parameter an option; a flag has no metavar, and `names` such as ``--quick``."""
    return typer.Option(*names, metavar=metavar or None, help=text, rich_help_panel=panel, **more)


def bounded(metavar: str, text: str, least: float, most: float, *names: str) -> Any:
    """Return what makes a parameter an option that takes numbers from `least` to `most`."""

    def check(param: typer.CallbackParam, value: float | None) -> float | None:
        if value is not None and not least <= value <= most:
            raise BadInput(f"{param.opts[0]} {value:g}: expected {least:g} to {most:g}")
        return value

    return option(metavar, text, *names, callback=check)


def spread(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that takes the options of its parameters' dataclasses one by one, as typer reads them."""
    hints = get_type_hints(function, include_extras=True)
    parameters: list[Parameter] = []
    for name, parameter in signature(function).parameters.items():
        parameters += options_of(hints[name]) or [parameter.replace(annotation=hints[name])]

    def call(**given: Any) -> Any:
        return function(**{name: _parameter_value(name, hints[name], given) for name in signature(function).parameters})

    call.__name__ = function.__name__
    call.__annotations__ = {entry.name: entry.annotation for entry in parameters}
    keywords = [entry.replace(kind=Parameter.KEYWORD_ONLY) for entry in parameters]
    call.__signature__ = Signature(keywords)  # type: ignore[attr-defined]  # `inspect.signature` reads it
    return call


def options_of(group: Any) -> list[Parameter]:
    """Return the options that a dataclass declares, those of dataclasses in it too; none for another type."""
    parameters: list[Parameter] = []
    if is_dataclass(group):
        hints = get_type_hints(group, include_extras=True)
        for setting in fields(group):
            hint = hints[setting.name]
            if get_origin(hint) is Annotated:
                if hint.__metadata__[0].parser is not None:  # typer knows no types but its own
                    hint = Annotated[Any, *hint.__metadata__]
                kind, default = Parameter.KEYWORD_ONLY, setting.default
                parameters.append(Parameter(setting.name, kind, default=default, annotation=hint))
            parameters += options_of(hint)
    return parameters


def _parameter_value(name: str, hint: Any, given: Mapping[str, Any]) -> Any:
    """Return the value of a parameter or field: the one that was given, or the dataclass that its options make."""
    if not isinstance(hint, type) or not is_dataclass(hint):
        return given[name]
    hints = get_type_hints(hint, include_extras=True)
    names = [setting.name for setting in fields(hint) if setting.name in given or is_dataclass(hints[setting.name])]
    try:
        return hint(**{setting: _parameter_value(setting, hints[setting], given) for setting in names})
    except BadInput as error:  # fields have the names of their options, with a unit
        raise BadInput(re.sub(r"^([a-z]+)(_s|_m)? = ", r"--\1 ", str(error))) from None
