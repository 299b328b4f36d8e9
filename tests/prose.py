"""The prose of the code: findings that are to be rewritten, and counts to compare versions by.

    python -m tests.prose

Prints a line for each finding and exits with 1 if there is one: a docstring that opens with a question word, "nobody"
and the like for a process or a robot, a local variable whose name says nothing of what it holds. The last line has the
counts, for example how many words a function's name has; they fail nothing.
"""

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("patrol", "runtime", "agent", "worldsim", "monitor", "fogwatch", "experiments", "ros2", "bench")
OPENER = re.compile(r"(What|Whether|Who|Whose|Where|How|When|Why|By)\b")
PERSON = re.compile(r"\b(nobody|somebody|whoever)\b", re.IGNORECASE)
EXAMPLE = re.compile(r"\bexample|\be\.g\.", re.IGNORECASE)
VAGUE = {
    "found",
    "told",
    "made",
    "said",
    "one",
    "most",
    "given",
    "least",
    "taken",
    "kept",
    "heard",
    "asked",
    "held",
    "done",
    "gone",
    "stated",
    "each",
    "whole",
    "rest",
}
Documented = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
Function = ast.FunctionDef | ast.AsyncFunctionDef


def findings(path: str, text: str) -> Iterator[str]:
    """Yield a line ``FILE:LINE: finding`` for each sentence or name that is to be rewritten."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, Documented) and (docstring := ast.get_docstring(node)):
            where = f"{path}:{node.body[0].lineno}"
            if OPENER.match(docstring):
                yield f"{where}: opens with a question word: {docstring.splitlines()[0]}"
            if match := PERSON.search(docstring):
                yield f"{where}: {match.group()}: name the process, the robot or the person"
        if isinstance(node, Function):
            for name, line in sorted(_local_names(node).items()):
                if name in VAGUE:
                    yield f"{path}:{line}: local variable {name}: say what it holds"


def counts(texts: list[str]) -> str:
    """Return the counts of all files in one line."""
    words = examples = comments = code = name_words = functions = 0
    for text in texts:
        comments += sum(line.lstrip().startswith("#") for line in text.splitlines())
        code += sum(bool(line.strip()) for line in text.splitlines())
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, Documented) and (docstring := ast.get_docstring(node)):
                words += len(re.findall(r"[A-Za-z']+", docstring))
                examples += len(EXAMPLE.findall(docstring))
            if isinstance(node, Function) and not node.name.startswith("__"):
                functions += 1
                name_words += len(node.name.strip("_").split("_"))
    return (
        f"{name_words / functions:.2f} words in a function's name, {1000 * examples / words:.2f} examples per 1,000 "
        f"words, {100 * comments / code:.2f} comments per 100 lines"
    )


def _local_names(function: Function) -> dict[str, int]:
    """Return the names that a function itself binds, each with the first line that does."""
    stored = [node for node in ast.walk(function) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)]
    return {node.id: node.lineno for node in sorted(stored, key=lambda node: -node.lineno)}


def main() -> int:
    """Print findings and counts; return the exit code."""
    texts = {
        str(file.relative_to(ROOT)): file.read_text("utf-8")
        for package in PACKAGES
        for file in sorted((ROOT / package).rglob("*.py"))
    }
    lines = [line for path, text in texts.items() for line in findings(path, text)]
    print(*lines, sep="\n", end="\n" if lines else "")
    print(f"prose: {len(lines)} findings; {counts(list(texts.values()))}")
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
