"""The paper's forces with sliders, for the page for students.

The functions are those that robots run: the expressions of f1 to f5 and g1 to g5 in Python are JavaScript too, so the
page gets their source.
"""

from __future__ import annotations

import ast
import inspect
import json
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

from agent.policies.forces import distance_force, fow_force
from patrol.scenario import PotentialFieldOptions

OPTIONS = ("fow", "distance", "alpha", "beta", "length")
"""The policy's options that the page sets."""


def forces() -> str:
    """Return the sliders and the curves, as Markdown for Sphinx."""
    html = Path(__file__).with_suffix(".html").read_text(encoding="utf-8")
    defaults = {name: PotentialFieldOptions.model_fields[name].default for name in OPTIONS}
    for name, script in {
        "FOW": in_javascript(fow_force),
        "DISTANCE": in_javascript(distance_force),
        "DEFAULTS": json.dumps(defaults),
    }.items():
        html = html.replace(f'"{name}"', script)
    return f"```{{raw}} html\n{html}```"


def in_javascript(function: Callable[..., Any]) -> str:
    """Return a mapping from names to functions, of one that returns an expression for each name.

    Args:
        function: Matches its first argument with names; it becomes a function of its other arguments for each name.
    """
    source = textwrap.dedent(inspect.getsource(function))
    arguments = ", ".join([*inspect.signature(function).parameters][1:])
    expressions = {
        case.pattern.value.value: ast.get_source_segment(source, case.body[0].value)
        for case in ast.walk(ast.parse(source))
        if isinstance(case, ast.match_case)
        and isinstance(case.pattern, ast.MatchValue)
        and isinstance(case.pattern.value, ast.Constant)
        and isinstance(case.body[0], ast.Return)
        and case.body[0].value is not None
    }
    return "{" + ", ".join(f"{name}: ({arguments}) => {text}" for name, text in expressions.items()) + "}"
