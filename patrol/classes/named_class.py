"""Classes that a scenario names: policies and sensors, built-in ones and one's own.

A name is that of a built-in class, ``package.module:Class``, ``./file.py:Class`` beside the scenario, or the name of an
entry point of an installed package. For example, in a scenario:

    patrol: {policy: ./mine.py:Mine, options: {near: 4}}
    sensor: {kind: my_package.lidar:Lidar, range: 12}

A class may have a pydantic model named ``Options``, which validates its options. `find` runs the code that a name
stands for; `patrol.classes.static_check` looks at it without running it.
"""

from __future__ import annotations

import importlib
import inspect
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from pydantic import BaseModel, ValidationError

from patrol.classes.class_file import checked_source, class_file
from patrol.classes.exits import keep_process
from patrol.errors import BadInput, did_you_mean
from patrol.kernel_cache import keep_own


@dataclass(frozen=True, slots=True)
class ClassSort:
    """A sort of classes that scenarios name."""

    noun: str  # of one class, such as "policy"
    field: str  # dotted field of the scenario that names one, such as "patrol.policy"
    call: str  # the method that such a class must have, such as "decide(view)"
    group: str  # the entry points by which an installed package offers such classes
    # "module:Class" by name; imported only when a run uses one, because their kernels take time to load
    built_in: Mapping[str, str]

    @property
    def method(self) -> str:
        """The name of the method that such a class must have."""
        return self.call.partition("(")[0]

    @property
    def section(self) -> str:
        """The scenario's section that names one."""
        return self.field.partition(".")[0]


@dataclass(frozen=True, slots=True)
class NamedClass:
    """A class as a scenario names it."""

    sort: ClassSort
    name: str  # as the scenario has it, such as "./mine.py:Mine"
    sha256: str | None  # hex, of its file; None where the scenario does not say it
    options: Mapping[str, Any]

    @property
    def field(self) -> str:
        """The field with its value, for errors: ``patrol.policy = ./mine.py:Mine``."""
        return f"{self.sort.field} = {self.name}"


def find(named: NamedClass) -> type[Any]:
    """Import the class that a name stands for, and check that it has the method that its sort needs.

    Where the scenario gives a digest, a class's file must have it.
    """
    named_type = _import_named(named)
    if not inspect.isclass(named_type) or not callable(getattr(named_type, named.sort.method, None)):
        raise no_class(named)
    return named_type


def load(named: NamedClass) -> tuple[type[Any], Any]:
    """Import the class that a name stands for (`find`), and return it with its validated options."""
    named_type = find(named)
    return named_type, options_of(named, named_type)


def options_of(named: NamedClass, found: type[Any]) -> Any:
    """Return the validated options of a class: an instance of its own model, or an empty mapping without one."""
    options, field = dict(named.options), f"{named.sort.section}.options"
    model = getattr(found, "Options", None)
    if not (inspect.isclass(model) and issubclass(model, BaseModel)):
        if options:
            raise BadInput(f"{field} = {options}: {named.name} takes no options; leave them out")
        return {}
    known_options = ", ".join(model.model_fields) or "none"
    for name, value in options.items():
        if name not in model.model_fields and model.model_config.get("extra") != "allow":
            raise BadInput(f"{field}.{name} = {value!r}: unknown key; {named.name} has the options {known_options}")
    try:
        return model.model_validate(options)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in (field, *first["loc"]))
        value = first["input"]
        raise BadInput(f"{where} = {value!r}: {first['msg']}; {named.name} has the options {known_options}") from None


def entry_point_of(named: NamedClass) -> EntryPoint:
    """Find the entry point by which an installed package offers a class; nothing of the package runs."""
    sort, name = named.sort, named.name
    offered = {point.name: point for point in entry_points(group=sort.group)}
    if name not in offered:
        remedy = "or give package.module:Class or ./file.py:Class"
        raise BadInput(
            f"{named.field}: no such {sort.noun}; {_offer_names(name, [*sort.built_in, *sorted(offered)])}, {remedy}"
        )
    return offered[name]


def no_class(named: NamedClass) -> BadInput:
    """Make the error for a name that stands for something else."""
    return BadInput(f"{named.field}: is not a class with a method {named.sort.call}; name one that has it")


def absent_module(named: NamedClass, what: str) -> BadInput:
    """Make the error for a module that is not installed, or imports one that is not."""
    ours = named.name in named.sort.built_in
    remedy = "with: pip install 'fogwatch[experiments]'" if ours else "or give ./file.py:Class beside the scenario"
    return BadInput(f"{named.field}: {what}; install it{' ' if ours else ', '}{remedy}")


def absent_class(named: NamedClass, name: str, classes: list[str]) -> BadInput:
    """Make the error for a class that a module does not hold; it offers those that it holds."""
    return BadInput(f"{named.field}: has no {name}; {_offer_names(name, classes)}")


def raised(where: str, error: BaseException) -> BadInput:
    """Return the error for code of a class that raises."""
    return BadInput(f"{where}: raises {type(error).__name__}: {error}; correct it")


def _import_named(named: NamedClass) -> Any:
    """Import whatever the name stands for, of any type."""
    if named.name not in named.sort.built_in:
        keep_process()
    module_name, colon, name = named.sort.built_in.get(named.name, named.name).rpartition(":")
    if not colon:
        return _load_entry_point(named)
    path = class_file(named.name)
    try:
        module = importlib.import_module(module_name) if path is None else _module_of(path, named)
    except BadInput:
        raise
    except ModuleNotFoundError as error:
        raise absent_module(named, str(error)) from None
    except (Exception, SystemExit) as error:
        raise raised(named.field, error) from error
    if not hasattr(module, name):
        method = named.sort.method
        classes = [key for key, value in vars(module).items() if inspect.isclass(value) and hasattr(value, method)]
        raise absent_class(named, name, classes)
    return getattr(module, name)


def _load_entry_point(named: NamedClass) -> Any:
    point = entry_point_of(named)
    try:
        return point.load()
    except (Exception, SystemExit) as error:
        raise raised(f"{named.field} ({point.value})", error) from error


def _module_of(path: Path, named: NamedClass) -> ModuleType:
    """Load a file as a module, once in a process as long as its bytes stay the same.

    The file is read once, so that what is executed is what the digest stands for. Python's import system would prefer a
    file of byte code beside it, and numba one of machine code, and either may hold other code in a received folder.
    """
    if path.suffix != ".py":
        raise BadInput(f"{path}: is no Python file; give ./file.py:Class")
    source, digest = checked_source(path, named.sha256, named.sort.field)
    name = f"fogwatch_{named.sort.noun}_{digest}"
    if name in sys.modules:
        return sys.modules[name]
    keep_own(name, source)
    module = ModuleType(name)
    module.__file__ = str(path)
    sys.modules[name] = module
    try:
        exec(compile(source, str(path), "exec", dont_inherit=True), vars(module))
    except BaseException:
        del sys.modules[name]
        raise
    return module


def _offer_names(name: str, known: list[str]) -> str:
    return did_you_mean(name, known) if known else "there is none in it"
