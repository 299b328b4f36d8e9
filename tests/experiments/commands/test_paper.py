"""``fogwatch reproduce table`` as a command, on coarse points and for seconds instead of hours."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import pytest
from PIL import Image
from rich.console import Console

from experiments.sweeps.page import print_page
from monitor.tables.table import Table
from tests.command_line import Command, output, refuses

TABLE = ("reproduce", "table")
QUICK = ("--set", "point=1", "--set", "duration=20", "--workers", "1")


@pytest.mark.processes
def test_a_table_is_made_to_the_letter(tmp_path: Path, run: Command) -> None:
    said = output(run(*TABLE, "4", "--letter", "--rows", "wave+mode", "--columns", "3", "--seeds", "1", *QUICK))
    assert "`patrol.options.letter: True`" in said
    page = (tmp_path / "runs" / "paper-letter" / "paper.md").read_text()
    assert "`patrol.options.ties: drawn`" in page


@pytest.mark.processes
def test_a_table_is_made_shown_and_written(tmp_path: Path, run: Command) -> None:
    part = ("--rows", "f3", "--columns", "g3,g4", "--seeds", "2", "--set", "sensor.range=11")
    said = output(run(*TABLE, "2", "3", *part, *QUICK, "--out", str(tmp_path)))
    assert "8 runs to make; 1 at a time\n" in said
    assert "## Table 2: open field, 3 holonomic robots, vector sum" in said
    assert "Assumed: no dilatation" in said
    assert "`sensor.range: 11`" in said
    assert "(80.7) " in said
    assert "| open-field | on the open field vector sum is slightly better than mode (f3 g4) | " in said
    rows = list(csv.DictReader((tmp_path / "cells.csv").read_text().splitlines()))
    cells = [(row["table"], row["row"], row["column"], row["paper"], row["seeds"]) for row in rows]
    assert cells == [
        (number, "f3", column, value, "2")
        for number, column, value in (
            ("2", "g3", "101.5"),
            ("2", "g4", "80.7"),
            ("3", "g3", "98.5"),
            ("3", "g4", "90.0"),
        )
    ]
    page = (tmp_path / "paper.md").read_text()
    assert page.startswith("# The paper's tables, side by side")
    assert "![Mean MFoW (s)](figures/table-2-cases-mfow_mean_s.png)" in page
    with Image.open(tmp_path / "figures" / "table-2-cases-mfow_mean_s.png") as picture:
        assert min(picture.size) > 200
    said = output(run(*TABLE, "2", *part, *QUICK, "--out", str(tmp_path)))
    assert "0 runs made" in said
    assert not (tmp_path / "figures" / "table-3-cases-mfow_mean_s.png").exists(), "the plan no longer has it"


@pytest.mark.processes
def test_a_claim_is_tested_by_its_name(run: Command) -> None:
    assert "| open-field | on the open field vector sum is slightly better" in output(run("reproduce", "claim"))
    said = output(run("reproduce", "claim", "open-field", "--seeds", "2", *QUICK, "--out", "out"))
    assert "# The paper's claim open-field\n" in said
    assert said.count("| f3 (s) |") == 2
    verdict = said.partition("| open-field | on the open field vector sum is slightly better than mode (f3 g4) | ")[2]
    assert verdict.partition(" |")[0] in ("holds", "fails", "undecided")
    assert " | 0.90 |\n" in verdict
    (row,) = csv.DictReader(Path("out/claims.csv").read_text().splitlines())
    assert (row["claim"], row["verdict"]) == ("open-field", verdict.partition(" |")[0])
    assert float(row["ci95_low"]) <= float(row["ratio"]) <= float(row["ci95_high"])


def test_an_unknown_claim_is_refused(run: Command) -> None:
    refuses(run("reproduce", "claim", "fuzy"), "claim fuzy: no such claim; did you mean fuzzy")


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["9"], "table 9: no such table; choose from 2 to 8"),
        (["two"], "N... two: expected a whole number"),
        (["2", "--set", "point=0"], "point"),
        (["2", "--set", "sensor.range=-3"], "sensor.range = -3"),
        (["2", "--set", "duration=0.1"], "duration"),
        (["2", "--rows", "f9"], "--rows f9: no such name"),
        (["2", "--seeds", "0"], "seeds = 0"),
        (["2", "--cluster", "nowhere"], "cluster = nowhere: cannot be reached"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(run: Command, words: list[str], problem: str) -> None:
    refuses(run(*TABLE, *words, "--out", "out"), problem, at_once="--cluster" not in words)


def test_a_page_is_a_grid_on_a_terminal_and_markdown_elsewhere() -> None:
    parts = ["# Title", Table(("row", "a"), [("f3", "1.5 **x 2.00**")]).markdown()]
    text = io.StringIO()
    print_page(Console(file=text, width=80), parts)
    assert text.getvalue() == "# Title\n\n| row | a |\n|---|---|\n| f3 | 1.5 **x 2.00** |\n"
    console = Console(record=True, width=80, force_terminal=True, file=io.StringIO())
    print_page(console, parts)
    assert "1.5 x 2.00" in console.export_text()
