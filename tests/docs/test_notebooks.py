"""The notebooks of the documentation, and its page on Python: each executed from its first block to its last.

`make docs` executes the notebooks for the site.
"""

import html
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from docs.notebooks.ipynb import notebook

ROOT = Path(__file__).resolve().parents[2]
SITE = ROOT / "build" / "site" / "docs" / "notebooks"
API = ROOT / "docs" / "python-api.md"
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.md"))
END = "</div>\n</div>"
"""Of a cell's input or output on a page."""

TAG = re.compile(r"<[^>]+>")
CELL = re.compile(r"^```(?:\{code-cell\} ipython3(?:\n:tags: [^\n]*)?|python)\n(.*?)^```$", re.MULTILINE | re.DOTALL)

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


def cells(source: Path) -> list[str]:
    return CELL.findall(source.read_text(encoding="utf-8"))


def test_there_are_four() -> None:
    names = {source.stem for source in NOTEBOOKS}
    assert names == {"first-patrol", "your-policy", "packet-loss", "how-many-robots"}
    for source in NOTEBOOKS:
        text = source.read_text(encoding="utf-8")
        assert text.startswith("---\njupytext:\n")
        assert text.count("```{code-cell}") == len(cells(source)) >= 5


@pytest.mark.parametrize("source", NOTEBOOKS, ids=lambda document: document.stem)
def test_each_is_there_for_jupyter_too(source: Path) -> None:
    written = source.with_suffix(".ipynb").read_text(encoding="utf-8")
    assert written == notebook(source.read_text(encoding="utf-8")), "make tables writes it again"
    code = ["".join(cell["source"]) for cell in json.loads(written)["cells"] if cell["cell_type"] == "code"]
    assert code == [cell.rstrip("\n") for cell in cells(source)]


@pytest.mark.site
@pytest.mark.parametrize("source", NOTEBOOKS, ids=lambda document: document.stem)
def test_the_site_shows_what_every_cell_gives(source: Path) -> None:
    """The build ends with an error where a cell raises one."""
    page = (SITE / source.with_suffix(".html").name).read_text(encoding="utf-8")
    parts = (re.findall(rf'<div class="cell_{part} .*?{END}', page, re.DOTALL) for part in ("input", "output"))
    sources, outputs = ([html.unescape(TAG.sub("", block)) for block in part] for part in parts)
    assert [source.strip() for source in sources] == [cell.strip() for cell in cells(source)]
    assert len(outputs) >= 4
    for word in ("Error", "invalid", "DeprecationWarning"):
        assert not [output for output in outputs if word in output]


@pytest.mark.processes
def test_the_page_on_python_can_be_executed(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-W", "error::DeprecationWarning:__main__", "-c", RUNNER],
        input=json.dumps(cells(API)),
        cwd=tmp_path,
        env={**os.environ, "MPLBACKEND": "agg", "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Error" not in done.stdout
    assert "invalid" not in done.stdout
