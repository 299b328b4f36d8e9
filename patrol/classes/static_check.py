"""A look at a class that a scenario names, which runs nothing of it: its file, and a check of its source.

The class's source is found and parsed. So it is known whether the class is there; what it inherits, its options, and
whether it can be made at all is known only once it runs.
"""

from __future__ import annotations

import ast
import importlib.util
import sys
from collections.abc import Iterable, Iterator
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path

from patrol.classes.class_file import LONGEST, checked_source, class_file
from patrol.classes.named_class import NamedClass, absent_class, absent_module, entry_point_of, no_class, raised
from patrol.errors import printable

_Function = ast.FunctionDef | ast.AsyncFunctionDef


def check_without_running(named: NamedClass) -> None:
    """Check as much of a class as can be told without running it.

    A built-in class always passes.
    """
    if named.name in named.sort.built_in or (path := source_file(named)) is None:
        return
    source, _ = checked_source(path, named.sha256, named.sort.field)
    name = _module_and_name(named)[1]
    if len(source) > LONGEST or "." in name:
        return
    _check_class(source, name, named)


def source_file(named: NamedClass) -> Path | None:
    """Find the file that a class of one's own comes from; nothing of it runs. None for one that is compiled."""
    return class_file(named.name) or _source_of(_module_and_name(named)[0], named)


def announce(classes: Iterable[NamedClass]) -> None:
    """Name classes of one's own and their files on the standard error output, before anything of them runs."""
    lines = []
    for named in classes:
        # Code of a module that is loaded already, as of a notebook's cells, has run.
        if named.name in named.sort.built_in or _module_and_name(named)[0] in sys.modules:
            continue
        path = source_file(named)
        what = "compiled" if path is None else f"imported from {path}"  # or from byte code beside it
        if path is not None and class_file(named.name) is not None:
            what = f"SHA-256 {checked_source(path, named.sha256, named.sort.field)[1][:12]}"
        lines.append(f"fogwatch: runs code: {named.field}, {what}")
    for line in lines:
        print(printable(line), file=sys.stderr, flush=True)


def _module_and_name(named: NamedClass) -> tuple[str, str]:
    module_name, colon, name = named.name.rpartition(":")
    if not colon:
        point = entry_point_of(named)
        module_name, name = point.module, point.attr
    return module_name, name


def _source_of(module: str, named: NamedClass) -> Path | None:
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
            raise absent_module(named, f"No module named {name!r}")
    origin = None if spec is None else spec.origin
    return Path(origin) if origin is not None and origin.endswith(".py") else None


def _top_level(name: str) -> ModuleSpec | None:
    try:
        return importlib.util.find_spec(name)
    except (ImportError, ValueError):  # ValueError: a module of this process that comes from nowhere
        return None


def _check_class(source: bytes, name: str, named: NamedClass) -> None:
    try:
        module = ast.parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise raised(named.field, error) from None
    method = named.sort.method
    bound: dict[str, ast.stmt] = {}
    for statement in _walk_statements(module.body):
        for key in _names_bound(statement):
            bound[key] = statement
    if "*" in bound:
        return  # of what another module holds
    if name not in bound:
        classes = [key for key, node in bound.items() if isinstance(node, ast.ClassDef) and _may_have(node, method)]
        raise absent_class(named, name, classes)
    node = bound[name]
    if isinstance(node, _Function) or (isinstance(node, ast.ClassDef) and not _may_have(node, method)):
        raise no_class(named)


def _walk_statements(body: Iterable[ast.stmt]) -> Iterator[ast.stmt]:
    """Give the statements of a module or class, and those inside of its branches, not of its functions and classes."""
    for statement in body:
        yield statement
        if not isinstance(statement, ast.ClassDef | _Function):
            yield from _walk_statements(child for child in _child_statements(statement))


def _child_statements(statement: ast.stmt) -> Iterator[ast.stmt]:
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


def _may_have(made: ast.ClassDef, method: str) -> bool:
    """Return True if a class has a method, or may get it from elsewhere."""
    if made.bases or made.keywords or made.decorator_list:
        return True
    return any(method in _names_bound(statement) for statement in _walk_statements(made.body))
