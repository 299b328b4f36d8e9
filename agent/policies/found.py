"""The search for the policy that a scenario names, and the check of its options.

A policy is ``committed`` (the default), ``potential-field`` (the paper's), ``package.module:Class``,
``./file.py:Class`` beside the scenario, or the name of an entry point in the group ``fogwatch.policies``. Only what
runs minds comes here: no command that only reads a run imports its policy.
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from pydantic import BaseModel, ValidationError

from agent.ports import Policy, PolicySetup
from patrol.errors import BadInput, did_you_mean
from patrol.scenario.policies import PatrolOptions
from patrol.scenario.policy_file import COMMITTED, PAPER, policy_digest, policy_file

if TYPE_CHECKING:
    from patrol.scenario import PatrolSpec, Scenario

GROUP = "fogwatch.policies"
"""The entry points by which an installed package offers policies."""


_BUILT_IN: Mapping[str, str] = {
    COMMITTED: "agent.policies.committed.policy:Committed",
    PAPER: "agent.policies.potential_field.policy:PotentialField",
}
"""The modules of the built-in policies, imported when a run uses them: their kernels take time to load."""


@dataclass(frozen=True, slots=True)
class PolicyKind:
    """A scenario's policy.

    Attributes:
        name: As the scenario has it.
        make: Makes the policy of one robot.
        options: The scenario's options as the policy's own model; an empty mapping where it has none.
        ours: It comes with fogwatch, so that its failures are bugs.
    """

    name: str
    make: Callable[[PolicySetup], Policy]
    options: Any
    ours: bool


def policy_of(scenario: Scenario) -> PolicyKind:
    """Return the policy that a scenario names, with its options.

    Raises:
        BadInput: It cannot be found or loaded, its file is not the one that the scenario was resolved with, or it does
            not take the options.
    """
    patrol = scenario.patrol
    found = _load(patrol)
    if not inspect.isclass(found) or not callable(getattr(found, "decide", None)):
        raise no_class(patrol.policy)
    make = cast(Callable[[PolicySetup], Policy], found)
    return PolicyKind(patrol.policy, make, _options(patrol, found), patrol.policy in _BUILT_IN)


def _load(patrol: PatrolSpec) -> Any:
    """Load the class that the policy's name stands for."""
    place, colon, name = _BUILT_IN.get(patrol.policy, patrol.policy).rpartition(":")
    if not colon:
        return _entry_point(patrol.policy)
    path = policy_file(patrol.policy)
    try:
        module = importlib.import_module(place) if path is None else _module_of(path, patrol)
    except BadInput:
        raise
    except ModuleNotFoundError as error:
        raise absent_module(patrol.policy, str(error)) from None
    except (Exception, SystemExit) as error:
        raise BadInput(
            f"patrol.policy = {patrol.policy}: raises {type(error).__name__}: {error}; correct it"
        ) from error
    if not hasattr(module, name):
        classes = [one for one, value in vars(module).items() if inspect.isclass(value) and hasattr(value, "decide")]
        raise absent_class(patrol.policy, name, classes)
    return getattr(module, name)


def entry_point_of(name: str) -> EntryPoint:
    """Find the entry point by which an installed package offers a policy; nothing of the package runs.

    Args:
        name: Of the policy.

    Raises:
        BadInput: There is none of that name.
    """
    offered = {point.name: point for point in entry_points(group=GROUP)}
    if name not in offered:
        remedy = "or give package.module:Class or ./file.py:Class"
        raise BadInput(
            f"patrol.policy = {name}: no such policy; {_offer(name, [*_BUILT_IN, *sorted(offered)])}, {remedy}"
        )
    return offered[name]


def _entry_point(name: str) -> Any:
    point = entry_point_of(name)
    try:
        return point.load()
    except (Exception, SystemExit) as error:
        raise BadInput(
            f"patrol.policy = {name} ({point.value}): raises {type(error).__name__}: {error}; correct it"
        ) from error


def check_digest(path: Path, patrol: PatrolSpec) -> str:
    """Check that a policy's file is the one that its scenario was resolved with.

    Args:
        path: The file.
        patrol: The scenario's section.

    Returns:
        The SHA-256 (hex) of the file.

    Raises:
        BadInput: It is another, or cannot be read.
    """
    digest = policy_digest(path)
    if patrol.policy_sha256 is not None and digest != patrol.policy_sha256:
        raise BadInput(
            f"{path}: is not the file that this scenario was resolved with (SHA-256 {digest[:12]}, it says "
            f"{patrol.policy_sha256[:12]}); restore it, or drop patrol.policy_sha256 to run with this one"
        )
    return digest


def _module_of(path: Path, patrol: PatrolSpec) -> Any:
    """Return a file as a module; loaded once in a process, as long as its bytes stay the same."""
    name = f"fogwatch_policy_{check_digest(path, patrol)[:16]}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise BadInput(f"{path}: is no Python file; give ./file.py:Class")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def _options(patrol: PatrolSpec, found: Any) -> Any:
    if isinstance(patrol.options, PatrolOptions):
        return patrol.options
    given = dict(patrol.options or {})
    model = getattr(found, "Options", None)
    if not (inspect.isclass(model) and issubclass(model, BaseModel)):
        if given:
            raise BadInput(f"patrol.options = {given}: {patrol.policy} takes no options; leave them out")
        return {}
    known = ", ".join(model.model_fields) or "none"
    for name, value in given.items():
        if name not in model.model_fields and model.model_config.get("extra") != "allow":
            raise BadInput(f"patrol.options.{name} = {value!r}: unknown key; {patrol.policy} has the options {known}")
    try:
        return model.model_validate(given)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in ("patrol", "options", *first["loc"]))
        value = first["input"]
        raise BadInput(f"{where} = {value!r}: {first['msg']}; {patrol.policy} has the options {known}") from None


def no_class(policy: str) -> BadInput:
    """Return the error for a name that stands for no policy."""
    return BadInput(f"patrol.policy = {policy}: is not a class with a method decide(view); name one that has it")


def absent_module(policy: str, what: str) -> BadInput:
    """Return the error for a module that is not installed, or imports one that is not."""
    return BadInput(f"patrol.policy = {policy}: {what}; install it, or give ./file.py:Class beside the scenario")


def absent_class(policy: str, name: str, classes: list[str]) -> BadInput:
    """Return the error for a class that a module does not hold; it offers those that it holds."""
    return BadInput(f"patrol.policy = {policy}: has no {name}; {_offer(name, classes)}")


def _offer(name: str, known: list[str]) -> str:
    return did_you_mean(name, known) if known else "there is none in it"
