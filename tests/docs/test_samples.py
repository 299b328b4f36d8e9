"""The documentation's figures have commands that make them again, and its numbers samples that are measured again."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from typer.main import get_command

from docs.samples import main
from fogwatch.cli.app import app

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
FIGURES = {row["figure"]: row for row in json.loads((DOCS / "pictures" / "figures.json").read_text(encoding="utf-8"))}
PICTURE = re.compile(r"(?:!\[[^\]]*\]\(|\bsrc=\"|\bsrcset=\")([^)\"\s]+\.(?:png|svg|webp|gif))")

MADE_BY = re.compile(r"Made by `([^`]*)`|^    (fogwatch [^#\n]*?) *(?:#.*)?$", re.MULTILINE)


def pictures_of_documents() -> set[Path]:
    """Every picture that a page shows."""
    shown = set()
    for page in [DOCS.parent / "README.md", *DOCS.rglob("*.md")]:
        shown |= {(page.parent / name).resolve() for name in PICTURE.findall(page.read_text(encoding="utf-8"))}
    return shown


def test_every_picture_of_the_documentation_has_its_command() -> None:
    patterns = [pattern for figure in FIGURES.values() for pattern in figure["files"]]
    made = {pattern: set(DOCS.glob(pattern)) for pattern in patterns}
    assert all(made.values()), "every pattern stands for a picture"
    shown = pictures_of_documents()
    assert len(shown) > 20
    assert shown <= set().union(*made.values())


def test_the_commands_are_those_that_the_pages_name() -> None:
    pages = [page.read_text(encoding="utf-8") for page in DOCS.rglob("*.md")]
    recorded = {line for page in pages for made_by in MADE_BY.findall(page) for line in made_by}
    for figure in FIGURES.values():
        program, *words = shlex.split(figure["command"])
        if program == "python":
            assert (DOCS.parent / words[0]).is_file()
            continue
        command: Any = get_command(app)
        while hasattr(command, "commands"):
            command = command.commands[words.pop(0)]
        command.make_parser(command.context_class(command)).parse_args(words)
        whole = re.sub(r"table \d", "table", figure["command"])
        assert whole in recorded


@pytest.mark.processes
def test_the_pictures_of_the_rules_come_out_the_same(tmp_path: Path) -> None:
    command = [sys.executable, *shlex.split(FIGURES["rules"]["command"])[1:], "--out", str(tmp_path / "new")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stderr
    ours = {path.name: path for path in (DOCS / "pictures/rules").glob("*.png")}
    assert {path.name for path in (tmp_path / "new").iterdir()} == set(ours)
    for name, path in ours.items():
        with Image.open(path) as old, Image.open(tmp_path / "new" / name) as new:
            differs = np.abs(np.asarray(old.convert("RGB"), dtype=np.int16) - np.asarray(new.convert("RGB"), np.int16))
        assert differs.mean() < 1.0, f"{name} differs by more than fonts and smoothing"


# --- documented numbers are measured again, and those that have changed are named ------------------------------------


PAGE = "| no limit | 50.4 ± 0.9 |\n| slow |\n60 s in\n the mean |\n"
NO_LIMIT = r"no limit \| ([\d.]+) ± ([\d.]+)"


@pytest.fixture(name="clone")
def make_clone(tmp_path: Path) -> Path:
    (tmp_path / "docs" / "results").mkdir(parents=True)
    (tmp_path / "docs" / "results" / "radio.md").write_text(PAGE)
    (tmp_path / "measured.json").write_text(json.dumps({"mfow": [30.6, 51.2], "share": 0.55}))
    return tmp_path


def samples(clone: Path, *given: dict[str, object]) -> None:
    common = {"commands": ["json.tool {clone}/measured.json"]}
    content = {"pages": {"radio": [{**common, **sample} for sample in given]}, "unsampled": {"speed": "times"}}
    (clone / "docs" / "results" / "samples.json").write_text(json.dumps(content))


def test_a_number_beyond_its_interval_is_named(clone: Path, capsys: pytest.CaptureFixture[str]) -> None:
    samples(clone, {"says": NO_LIMIT, "value": "stdout:mfow.0"}, {"says": NO_LIMIT, "value": "stdout:mfow.1"})
    assert main(root=clone) == 1
    changed, same, count = capsys.readouterr().out.splitlines()
    assert changed.startswith("changed docs/results/radio.md: 50.4 (within 0.95), now 30.6: json.tool ")
    assert same.startswith("same    docs/results/radio.md: 50.4 (within 0.95), now 51.2: ")
    assert count == "1 of 2 numbers have changed"


def test_without_an_interval_a_tenth_or_the_samples_own_counts(clone: Path, capsys: pytest.CaptureFixture[str]) -> None:
    slow = {"says": r"(\d+) s in the mean", "value": "stdout:share", "scale": 100}
    samples(clone, slow)
    assert main("radio", clone) == 0
    assert "60 (within 6.5), now 55" in capsys.readouterr().out
    samples(clone, {**slow, "within": 1})
    assert main("radio", clone) == 1


@pytest.mark.parametrize(
    ("sample", "page", "says"),
    [
        (
            {"says": "no such ([0-9]+)", "value": "stdout:share"},
            None,
            "docs/results/radio.md: has no text like no such",
        ),
        ({"says": NO_LIMIT, "value": "stdout:nothing"}, None, "radio: stdout:nothing: no number there"),
        ({"says": NO_LIMIT, "value": "x:y", "commands": ["json.tool --x"]}, None, "json.tool --x: exit code"),
        ({"says": NO_LIMIT, "value": "stdout:share"}, "speed", "speed: no page of docs/results that has samples"),
    ],
)
def test_what_cannot_be_checked_is_one_line(
    clone: Path, sample: dict[str, object], page: str | None, says: str
) -> None:
    samples(clone, sample)
    with pytest.raises(SystemExit, match=says):
        main(page, clone)
