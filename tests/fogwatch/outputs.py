"""Figures that users read of a few runs full of features, and the tool that writes them down.

    python -m tests.fogwatch.outputs                   # run every case, and write the figures to outputs.json
    python -m tests.fogwatch.outputs office graph      # the same for some cases; the others stay

A case is a folder with files, and commands that run in it, in this process. Its figures are what the commands print and
the files that they write, without wall-clock times. Like trace hashes they hold on processors of one kind, with one
Python, C library and lock file (`tests.accept.trace_cases.made_on`).
"""

import csv
import hashlib
import io
import json
import math
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import chdir, redirect_stderr, redirect_stdout
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from unittest.mock import patch

from tests.accept.trace_cases import made_on
from tests.fogwatch.output_cases import CASES

WRITTEN = Path(__file__).with_name("outputs.json")
MAPS = Path(__file__).parents[2] / "examples" / "maps"

UNREAD = {"scenario_hash", "wall_s", "realtime_factor", "version", "software", "processor_s"}
"""Figures that depend on the machine or version, or that other tests hold."""
WALL = re.compile(r"decision_ms|wall_s|^p50|^p99|^cpu_s$|^key$|trace_hash")
"""Names of columns, figures and cells of wall-clock times, and of what other tests hold."""
SECTIONS = ("decisions", "scenario")
"""Sections of reports that hold wall-clock times, or the input."""
LINES = re.compile(r"of wall time|^(trace|files|tick |writing)|[0-9] ms\b|ticks/s|compil|[0-9a-f]{64}| started 2")
"""Printed lines with wall-clock times, folders and hashes."""
DURATIONS = re.compile(r"(made|made now|regions found) in [0-9][^;]*|; [^;]* left$|; 1 at a time.*")
"""Wall-clock times within lines."""
HASH = re.compile(r"[0-9a-f]{64}")


class Shown(HTMLParser):
    """The words of a page by section, a line for each row of a table, and a digest of the lines of each chart."""

    def __init__(self, page: str) -> None:
        """Read a page."""
        super().__init__()
        self.sections: dict[str, list[str]] = {}
        self._section = ""
        self._row: list[str] | None = None
        self._skipped = ""
        self._drops = False
        self._chart: tuple[str, list[str]] | None = None
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Enter a section, row, chart or something that is not read."""
        given = dict(attrs)
        if tag == "svg":
            self._chart = given.get("aria-label") or "", []
        elif self._chart is not None:
            self._chart[1].extend(f"{name} {value}" for name, value in attrs if name in ("d", "x", "y", "points"))
        elif tag in ("script", "style"):
            self._skipped = tag
        elif tag == "section":
            self._section = given.get("id") or ""
        elif tag == "tr":
            self._row = []
        elif tag in ("td", "th"):
            self._drops = bool(WALL.search(given.get("data-head") or ""))

    def handle_endtag(self, tag: str) -> None:
        """Leave it."""
        if tag == "svg" and self._chart is not None:
            name, drawn = self._chart
            self._say(f"chart {name}: {digest(drawn)}")
            self._chart = None
        elif tag == "section":
            self._section = ""
        elif tag == "tr" and self._row is not None:
            row, self._row = self._row, None
            self._say(" | ".join(row))
        elif tag in ("td", "th"):
            self._drops = False
        elif tag == self._skipped:
            self._skipped = ""

    def handle_data(self, data: str) -> None:
        """Take words."""
        words = " ".join(data.split())
        if not words or self._skipped or self._chart is not None or self._drops:
            return
        if self._row is None:
            self._say(words)
        else:
            self._row.append(words)

    def _say(self, line: str) -> None:
        if self._section not in SECTIONS and not LINES.search(line):
            self.sections.setdefault(self._section or "page", []).append(line)


def digest(parts: Sequence[str]) -> str:
    """Return a short digest of texts in order."""
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:12]


def table(text: str) -> dict[str, Any]:
    """Return a table's number of rows, and of each column its ends and a sum that tells the order."""
    head, *rows = csv.reader(io.StringIO(text))
    found: dict[str, Any] = {"rows": len(rows), "columns": ", ".join(head)}
    for place, name in enumerate(head):
        if WALL.search(name) or name in UNREAD:
            continue
        cells = [row[place] for row in rows]
        try:
            weighted = [(1 + k % 97) * float(cell) for k, cell in enumerate(cells) if cell]
            total: float | str = math.fsum(weighted)
        except ValueError:
            total = digest(cells)
        found[name] = [f"{cells[0]} ... {cells[-1]}", total] if any(cells) else ""
    return found


def document(value: Any) -> Any:
    """Return a JSON document without what is not read."""
    if isinstance(value, Mapping):
        return {k: document(part) for k, part in value.items() if k not in UNREAD and not WALL.search(k)}
    return [document(part) for part in value] if isinstance(value, list) else value


def lines(text: str) -> list[str]:
    """Return printed lines, without those that are not read and without the columns of wall-clock times."""
    found, cut = [], None
    for line in text.splitlines():
        if (at := line.find("p50 ms")) >= 0:
            cut = at - 3
        elif line.startswith("verdict"):
            cut = None
        if not LINES.search(line):
            found.append(DURATIONS.sub(r"\1", line[:cut].rstrip()))
    return found


def figures(path: Path) -> Any:
    """Return the figures of a file, None for those that are not read."""
    text = path.read_text(encoding="utf-8") if path.suffix in (".json", ".csv", ".html", ".tex", ".md") else ""
    match path.suffix:
        case ".json":
            return document(json.loads(text))
        case ".csv":
            return table(text)
        case ".html":
            return Shown(text).sections
        case ".tex" | ".md":
            return lines(text)
    return None


def command(words: str) -> tuple[int, str]:
    """Run the command in this process; its exit code and what it printed."""
    from fogwatch.cli.app import main

    said = io.StringIO()
    argv = patch.object(sys, "argv", ["fogwatch", *words.split()])
    with argv, redirect_stdout(said), redirect_stderr(io.StringIO()) as wrong:
        code = main()
    return code, said.getvalue() or wrong.getvalue()


def outputs(name: str, folder: Path) -> dict[str, Any]:
    """Run a case in an empty folder; all its figures, by command or file."""
    case = CASES[name]
    shutil.copytree(MAPS, folder / "maps")
    for file, content in case.files.items():
        (folder / file).write_text(json.dumps(content), encoding="utf-8")
    found: dict[str, Any] = {}
    with chdir(folder), patch("patrol.measures.best_tour.user_cache", return_value=None):  # tours are found anew
        for words in case.commands:
            code, text = command(words)
            found[words] = {"exit code": code, "printed": lines(text.replace(f"{folder}/", ""))}
        for path in sorted(Path().rglob("*")):
            unread = path.parts[0] == "maps" or str(path) in (*case.files, "sweep/summary.json")  # summary.csv holds it
            if not unread and (read := figures(path)) is not None:
                found[str(path)] = read
    return flat(json.loads(json.dumps(found)))


def flat(value: Any) -> dict[str, Any]:
    """Return every figure of a document by the path to it; a line's place in a text is one."""

    def walk(at: str, part: Any) -> Iterator[tuple[str, Any]]:
        if isinstance(part, dict | list) and part:
            for key, inner in part.items() if isinstance(part, dict) else enumerate(part):
                yield from walk(f"{at}: {key}" if at else str(key), inner)
        elif not HASH.fullmatch(str(part)):
            yield at, part

    return dict(walk("", value))


def same(pinned: Any, now: Any) -> bool:
    """Return whether a figure is as pinned: numbers with a fraction to nine digits, all else exactly."""
    if isinstance(pinned, float) and isinstance(now, float):
        return math.isclose(pinned, now, rel_tol=1e-9, abs_tol=1e-12)
    return type(pinned) is type(now) and bool(pinned == now)


def differences(pinned: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """Return a line for each figure that is not as pinned."""
    nothing = "nothing"
    return [
        f"{name}: pinned {pinned.get(name, nothing)!r}, now {now.get(name, nothing)!r}"
        for name in {**pinned, **now}
        if name not in pinned or name not in now or not same(pinned[name], now[name])
    ]


def main() -> None:
    """Write the figures of all cases, or of those that are named."""
    names = sys.argv[1:] or list(CASES)
    kept = json.loads(WRITTEN.read_text(encoding="utf-8"))["figures"] if sys.argv[1:] else {}
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            kept[name] = outputs(name, Path(folder).resolve())
        print(f"{name}: {len(kept[name])} figures", flush=True)
    says = {"made_on": made_on(), "figures": {name: kept[name] for name in CASES}}
    WRITTEN.write_text(json.dumps(says, indent=0, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    from tests.conftest import TERMINAL

    for variable in TERMINAL:
        os.environ.pop(variable, None)
    main()
