"""Kernels as plain Python that refuse every negative index, which Python and numba count from the end instead.

An index beyond the end is refused by Python itself, in lists and scratch arrays too. `USED` tells at which of all
places in the source, `PLACES`, an index was ever used.
"""

import ast
import os
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

import numpy as np
from numba import types

from patrol import kernel_cache

PLACES: set[str] = set()
"""Where an index, or a bound of a slice, stands that is no number: module, kernel, line and column."""

USED: set[str] = set()
_WHOLE = 2**64 - 1


def kernel_of(place: str) -> str:
    """Return the module and name of the kernel that an index is in."""
    return place.rsplit(":", 2)[0]


def refuse(index: Any, place: str) -> Any:
    """Return an index, or raise IndexError if it is negative."""
    USED.add(place)
    if isinstance(index, int | np.integer) and index < 0:
        raise IndexError(f"{place}: {index} is negative")
    return index


class _Checks(ast.NodeTransformer):
    """Puts the check around each index in the kernels of a module."""

    def __init__(self, module: str) -> None:
        self._module = module
        self._kernel = ""

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.FunctionDef:
        if any(isinstance(by, ast.Call) and getattr(by.func, "id", "") == "njit" for by in node.decorator_list):
            self._kernel = f"{self._module}:{node.name}"
            node.body = [self.visit(statement) for statement in node.body]
            self._kernel = ""
        return node

    def visit_Subscript(self, node: ast.Subscript) -> ast.Subscript:
        self.generic_visit(node)
        if self._kernel:
            node.slice = self._checked(node.slice)
        return node

    def _checked(self, index: ast.expr) -> ast.expr:
        if isinstance(index, ast.Tuple):
            index.elts = [self._checked(part) for part in index.elts]
        elif isinstance(index, ast.Slice):
            index.lower, index.upper = (bound and self._checked(bound) for bound in (index.lower, index.upper))
        elif not isinstance(index, ast.Constant):
            place = f"{self._kernel}:{index.lineno}:{index.col_offset}"
            PLACES.add(place)
            return ast.Call(ast.Name("_refuse", ast.Load()), [index, ast.Constant(place)], [])
        return index


def checked_code(name: str, path: str) -> CodeType:
    """Return the code of a kernel module with its indices checked."""
    tree = _Checks(name).visit(ast.parse(Path(path).read_bytes()))
    return compile(ast.fix_missing_locations(tree), path, "exec")


def install() -> None:
    """Check the indices of all kernels that this process imports from now on; needs `NUMBA_DISABLE_JIT=1`."""
    if os.environ.get("NUMBA_DISABLE_JIT") != "1":
        raise ValueError("indices are checked with NUMBA_DISABLE_JIT=1 only")

    def execute(loading: SourceFileLoader, module: ModuleType) -> None:
        vars(module)["_refuse"] = refuse
        exec(checked_code(module.__name__, loading.path), vars(module))
        for name, value in list(vars(module).items()):
            if isinstance(value, np.dtype) and value.names:  # kernels name the fields of a record as attributes
                setattr(module, name, np.dtype((np.record, value)))

    # Numba's signed numbers are Python's here: numpy's booleans, which comparing numpy's give, have no arithmetic.
    integer: Any = types.Integer
    integer.cast_python_value = lambda kind, value: int(value) if kind.signed else np.uint64(int(value) & _WHOLE)
    loader: Any = kernel_cache._KernelLoader
    loader.exec_module = execute
