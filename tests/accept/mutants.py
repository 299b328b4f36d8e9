"""One-line bugs drawn at random out of the product's files: which of them do the tests miss?

    python -m tests.accept.mutants --count 40 --seed 1 patrol/zones monitor        # mutants of these files and folders

Each mutant is put into a copy of the working tree, where the quick tests of the file (or else those that import it),
those of the folder that mirrors its, and the pinned outputs (`tests/fogwatch/test_outputs.py`) run. A survivor is
printed as ``path:line before -> after``. Some survivors change nothing that counts; each of the others wants a test of
its kind.
"""

import argparse
import ast
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from patrol.random import draw

ROOT = Path(__file__).resolve().parents[2]
PRODUCT = ("agent", "experiments", "fogwatch", "monitor", "patrol", "ros2", "worldsim")
PINNED = "tests/fogwatch/test_outputs.py"
LIMIT_S = 600
"""A mutant that takes longer is found: it hangs."""

_PAIRS = "< <=, > >=, == !=, + -, * /, and or, min max, any all, minimum maximum, in not_in, is is_not"
SWAPPED = {
    this.replace("_", " "): other.replace("_", " ")
    for pair in _PAIRS.split(", ")
    for this, other in (pair.split(), reversed(pair.split()))
} | {"//": "/"}
"""What is written instead of an operator or a name."""


@dataclass(frozen=True)
class Mutant:
    """A part of one line of a file, and what is written instead."""

    path: str
    line: int
    begin: int
    end: int
    text: str

    def apply(self, source: str) -> str:
        """Return the file's text with the bug in it; columns count bytes, as in `ast`."""
        lines = source.splitlines(keepends=True)
        row = lines[self.line - 1].encode()
        lines[self.line - 1] = (row[: self.begin] + self.text.encode() + row[self.end :]).decode()
        return "".join(lines)

    def shown(self, source: str) -> str:
        """Return where it is, and the line before and after."""
        before, after = (text.splitlines()[self.line - 1].strip() for text in (source, self.apply(source)))
        return f"{self.path}:{self.line} {before} -> {after}"


class Sites(ast.NodeVisitor):
    """Collects the mutants of a file."""

    def __init__(self, path: str, source: str) -> None:
        """Read a file; texts and functions' annotations are left alone."""
        self._path, self._lines = path, [line.encode() for line in source.splitlines()]
        self.mutants: list[Mutant] = []
        self.visit(ast.parse(source))

    def _swap(self, line: int, begin: int, end: int) -> None:
        """Swap the operator or name between two columns of a line."""
        between = self._lines[line - 1][begin:end].decode()
        word = between.strip("() ")
        if word in SWAPPED:
            start = begin + between.index(word)
            self.mutants.append(Mutant(self._path, line, start, start + len(word), SWAPPED[word]))

    def _between(self, left: ast.expr, right: ast.expr) -> None:
        if left.end_lineno == right.lineno and left.end_col_offset is not None:
            self._swap(right.lineno, left.end_col_offset, right.col_offset)

    def visit_Compare(self, node: ast.Compare) -> None:
        """Swap each comparison's operator."""
        for left, right in zip([node.left, *node.comparators], node.comparators, strict=False):
            self._between(left, right)
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        """Swap an arithmetic operator."""
        self._between(node.left, node.right)
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        """Swap the first of several `and` or `or`."""
        self._between(*node.values[:2])
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        """Drop a `not` or a minus."""
        if isinstance(node.op, ast.Not | ast.USub) and node.lineno == node.operand.lineno:
            self.mutants.append(Mutant(self._path, node.lineno, node.col_offset, node.operand.col_offset, ""))
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        """Change a number by one, halve or double it."""
        was = node.value
        if isinstance(was, int | float) and not isinstance(was, bool) and node.end_col_offset is not None:
            near = (was + 1, was - 1) if isinstance(was, int) else (was / 2,)
            for value in (*near, was * 2):
                if value != was:
                    text = repr(value) if value >= 0 else f"({value!r})"
                    self.mutants.append(Mutant(self._path, node.lineno, node.col_offset, node.end_col_offset, text))

    def visit_Call(self, node: ast.Call) -> None:
        """Swap min and max and the like, and a call's first two arguments."""
        called, end = node.func, node.func.end_col_offset or 0
        if isinstance(called, ast.Name | ast.Attribute) and called.end_lineno is not None:
            name = called.id if isinstance(called, ast.Name) else called.attr
            self._swap(called.end_lineno, end - len(name), end)
        if len(node.args) > 1 and not any(isinstance(arg, ast.Starred) for arg in node.args[:2]):
            one, two = node.args[:2]
            if one.lineno == two.end_lineno and ast.dump(one) != ast.dump(two):
                row = self._lines[one.lineno - 1]
                first, comma = row[one.col_offset : one.end_col_offset], row[one.end_col_offset : two.col_offset]
                text = (row[two.col_offset : two.end_col_offset] + comma + first).decode()
                self.mutants.append(Mutant(self._path, one.lineno, one.col_offset, two.end_col_offset or 0, text))
        self.generic_visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        """Look at defaults and body, not at decorators and annotations."""
        for part in (*node.args.defaults, *filter(None, node.args.kw_defaults), *node.body):
            self.visit(part)

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Leave texts alone: positions within them are not given before Python 3.12."""


def tests_of(path: str) -> list[str]:
    """Return what tests a file: its own tests, those in the folder that mirrors its, and the pinned outputs.

    Kernels have no tests of their own: those that import one stand for them.
    """
    own = Path("tests", path).with_name(f"test_{Path(path).stem.lstrip('_')}.py")
    folder = own.parent
    while not list((ROOT / folder).glob("test_*.py")):
        folder = folder.parent
    importing = f"from {path.removesuffix('.py').replace('/', '.')} import "
    own_tests = (
        [own]
        if (ROOT / own).is_file()
        else [
            test.relative_to(ROOT)
            for test in sorted((ROOT / "tests").rglob("test_*.py"))
            if importing in test.read_text(encoding="utf-8")
        ]
    )
    found = [*map(str, own_tests), *([str(folder)] if len(folder.parts) > 2 else [])]
    return found if path.startswith("ros2/") else [*found, PINNED]  # which drives no robot of ROS 2


def passes(copy: Path, tests: str) -> bool:
    """Return whether tests of the quick suite pass in a copy, without those of real fleets."""
    options = ["-qx", "-p", "no:cacheprovider", "--suite", "quick", "-m", "not processes and not kind", tests]
    command = [sys.executable, "-m", "pytest", *options]
    environment = {**os.environ, "PYTHONPATH": str(copy)}
    try:
        ended = subprocess.run(command, cwd=copy, env=environment, capture_output=True, timeout=LIMIT_S, check=False)
    except subprocess.TimeoutExpired:
        return False
    return ended.returncode in (0, 5)  # 5: no test is quick


def drawn(paths: list[str], seed: int) -> Iterator[Mutant]:
    """Draw mutants of files and folders without repetition, a file as often as it has places for one."""
    files = sorted({p for path in paths for p in [ROOT / path, *(ROOT / path).rglob("*.py")] if p.suffix == ".py"})
    sites = [m for p in files for m in Sites(str(p.relative_to(ROOT)), p.read_text(encoding="utf-8")).mutants]
    for turn in range(len(sites)):
        mutant = sites.pop(int(draw(seed, turn) * len(sites)))
        with suppress(SyntaxError):  # brackets around an argument are no part of it
            ast.parse(mutant.apply((ROOT / mutant.path).read_text(encoding="utf-8")))
            yield mutant


def main() -> int:
    """Draw mutants, and print those that the tests miss."""
    parser = argparse.ArgumentParser(prog="python -m tests.accept.mutants", description=__doc__)
    parser.add_argument("paths", nargs="*", default=PRODUCT, help="files and folders (default: the whole product)")
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    asked, survivors, sound = parser.parse_args(), 0, set[str]()
    ignored = shutil.ignore_patterns(".git", ".venv", "build", "runs", "__pycache__", ".*_cache", ".hypothesis")
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder, "copy")
        shutil.copytree(ROOT, copy, ignore=ignored, symlinks=True)
        for number, mutant in enumerate(islice(drawn(list(asked.paths), asked.seed), asked.count), 1):
            file, chosen = copy / mutant.path, tests_of(mutant.path)
            source = file.read_text(encoding="utf-8")
            for tests in set(chosen) - sound:
                if not passes(copy, tests):
                    raise SystemExit(f"without any mutant these fail: {tests}")
                sound.add(tests)
            file.write_text(mutant.apply(source), encoding="utf-8")
            shutil.rmtree(file.parent / "__pycache__", ignore_errors=True)  # a mutant of the same size and second
            found = next((tests for tests in chosen if not passes(copy, tests)), "")
            file.write_text(source, encoding="utf-8")
            shutil.rmtree(file.parent / "__pycache__", ignore_errors=True)
            survivors += not found
            print(f"{number} {f'found by {found}' if found else 'SURVIVED'}: {mutant.shown(source)}", flush=True)
    print(f"{asked.count} mutants, {survivors} survived")
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
