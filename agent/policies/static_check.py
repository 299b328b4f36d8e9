"""A check of a scenario's policy that runs nothing of it, for commands that only look at the scenario.

The policy's source is found and parsed. So it is known whether the class is there; what it inherits, its options, and
whether it can be made at all is known only once it runs.
"""

from __future__ import annotations

import ast
import importlib.util
from collections.abc import Iterable, Iterator
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path

from agent.policies.found import absent_class, absent_module, check_digest, entry_point_of, no_class, policy_of
from patrol.errors import BadInput
from patrol.scenario import Scenario
from patrol.scenario.policy_file import BUILT_IN, policy_file, policy_source
from patrol.untrusted import KIB

LONGEST = 256 * KIB
"""Bytes of the longest source that is parsed; a parsed one takes some hundred times as much memory."""

_Function = ast.FunctionDef | ast.AsyncFunctionDef


def check_without_running(scenario: Scenario) -> None:
    """Check as much of a scenario's policy as can be told without running it.

    Args:
        scenario: The scenario.

    Raises:
        BadInput: The policy cannot be found, its file is not the one that the scenario was resolved with, or no class
            with a method `decide` can come of it.
    """
    patrol = scenario.patrol
    if patrol.policy in BUILT_IN:
        policy_of(scenario)
        return
    place, colon, name = patrol.policy.rpartition(":")
    if not colon:
        point = entry_point_of(patrol.policy)
        place, name = point.module, point.attr
    path = policy_file(patrol.policy)
    if path is not None:
        check_digest(path, patrol)
    else:
        path = _source_of(place, patrol.policy)
    if path is None:
        return  # it is compiled
    source = policy_source(path)
    if len(source) > LONGEST or "." in name:
        return
    _check_class(source, name, patrol.policy)


def _source_of(module: str, policy: str) -> Path | None:
    """Find a module's source without importing its package; None where there is none."""
    spec: ModuleSpec | None = None
    name = ""
    for part in module.split("."):
        if not name:
            name, spec = part, _top_level(part)
        elif spec is not None:
            name = f"{name}.{part}"
            spec = PathFinder.find_spec(name, spec.submodule_search_locations or [])
        if spec is None:
            raise absent_module(policy, f"No module named {name!r}")
    origin = None if spec is None else spec.origin
    return Path(origin) if origin is not None and origin.endswith(".py") else None


def _top_level(name: str) -> ModuleSpec | None:
    try:
        return importlib.util.find_spec(name)
    except (ImportError, ValueError):  # ValueError: a module of this process that comes from nowhere
        return None


def _check_class(source: bytes, name: str, policy: str) -> None:
    try:
        module = ast.parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise BadInput(f"patrol.policy = {policy}: raises {type(error).__name__}: {error}; correct it") from None
    bound: dict[str, ast.stmt] = {}
    for statement in _statements(module.body):
        for one in _names_bound(statement):
            bound[one] = statement
    if "*" in bound:
        return  # of what another module holds
    if name not in bound:
        classes = [one for one, made in bound.items() if isinstance(made, ast.ClassDef) and _may_decide(made)]
        raise absent_class(policy, name, classes)
    made = bound[name]
    if isinstance(made, _Function) or (isinstance(made, ast.ClassDef) and not _may_decide(made)):
        raise no_class(policy)


def _statements(body: Iterable[ast.stmt]) -> Iterator[ast.stmt]:
    """Give the statements of a module or class, and those inside of its branches, not of its functions and classes."""
    for statement in body:
        yield statement
        if not isinstance(statement, ast.ClassDef | _Function):
            yield from _statements(child for child in _children(statement))


def _children(statement: ast.stmt) -> Iterator[ast.stmt]:
    for child in ast.iter_child_nodes(statement):
        if isinstance(child, ast.stmt):
            yield child
        elif isinstance(child, ast.ExceptHandler | ast.match_case):
            yield from child.body


def _names_bound(statement: ast.stmt) -> Iterator[str]:
    match statement:
        case ast.ClassDef(name=name) | ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name):
            yield name
        case ast.Import(names=names) | ast.ImportFrom(names=names):
            for alias in names:
                yield alias.asname or alias.name.partition(".")[0]
        case ast.Assign() | ast.AnnAssign() | ast.For() | ast.With():
            for node in ast.walk(statement):
                if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                    yield node.id


def _may_decide(made: ast.ClassDef) -> bool:
    """Return True if a class has a method `decide`, or may get it from elsewhere."""
    if made.bases or made.keywords or made.decorator_list:
        return True
    return any("decide" in _names_bound(statement) for statement in _statements(made.body))
