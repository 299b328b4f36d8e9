"""The notebooks of the documentation, and its page on Python: each executed from its first block to its last."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
API = ROOT / "docs" / "python-api.md"
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.md"))
CELL = re.compile(r"^```(?:\{code-cell\} ipython3|python)\n(.*?)^```$", re.MULTILINE | re.DOTALL)

RUNNER = """
import ast, json, sys

def shown(value):
    html = getattr(value, "_repr_html_", None)
    return repr(value) if html is None else html()

for number, source in enumerate(json.loads(sys.stdin.read()), start=1):
    cell = ast.parse(source)
    last = cell.body.pop() if isinstance(cell.body[-1], ast.Expr) else None
    exec(compile(cell, f"cell {number}", "exec"))
    if last is not None:
        value = eval(compile(ast.Expression(last.value), f"cell {number}", "eval"))
        print(f"cell {number}: {'' if value is None else shown(value)}")
"""
"""Executes cells as a notebook does: all in one main module, showing the value of each cell's last expression."""


def cells(notebook: Path) -> list[str]:
    return CELL.findall(notebook.read_text(encoding="utf-8"))


def test_there_are_four() -> None:
    names = {notebook.stem for notebook in NOTEBOOKS}
    assert names == {"first-patrol", "your-policy", "packet-loss", "how-many-robots"}
    for notebook in NOTEBOOKS:
        text = notebook.read_text(encoding="utf-8")
        assert text.startswith("---\njupytext:\n")
        assert text.count("```{code-cell}") == len(cells(notebook)) >= 5


@pytest.mark.processes
@pytest.mark.parametrize("notebook", [*NOTEBOOKS, API], ids=lambda document: document.stem)
def test_every_cell_can_be_executed(notebook: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-W", "error::DeprecationWarning:__main__", "-c", RUNNER],
        input=json.dumps(cells(notebook)),
        cwd=tmp_path,
        env={**os.environ, "MPLBACKEND": "agg", "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Error" not in done.stdout
    assert "invalid" not in done.stdout
