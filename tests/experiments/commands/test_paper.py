"""``fogwatch reproduce table`` as a command, on coarse points and for seconds instead of hours."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import pytest
from PIL import Image
from rich.console import Console

from experiments.commands import paper as paper_commands
from experiments.paper.figures import table_picture
from experiments.paper.printed import paper
from experiments.paper.tables import PaperSetup, compare, plan_of
from experiments.sweeps.runner import SweepOutcome
from patrol.errors import BadInput
from tests.experiments.commands.conftest import Command, output, refuses
from tests.experiments.outcomes import outcome_of

TABLE = ("reproduce", "table")
QUICK = ("--point", "1", "--duration", "20", "--workers", "1")


@pytest.mark.processes
def test_a_table_is_made_to_the_letter(tmp_path: Path, run: Command) -> None:
    said = output(run(*TABLE, "4", "--letter", "--rows", "wave+mode", "--columns", "3", "--seeds", "1", *QUICK))
    assert "set: patrol.options.letter = True" in said
    assert "set: patrol.options.random_move_for = all" in said
    folder = tmp_path / "runs" / "paper-letter-1m"
    assert json.loads((folder / "table_4.json").read_text())["set"]["patrol.options.letter"] is True
    assert "Set in addition: `patrol.options.letter: true`." in (folder / "paper.md").read_text()


@pytest.mark.processes
def test_a_table_is_made_shown_and_written(tmp_path: Path, run: Command) -> None:
    part = ("--rows", "f3", "--columns", "g3,g4", "--seeds", "2", "--sensor-range", "11")
    said = output(run(*TABLE, "2", "3", *part, *QUICK, "--out", str(tmp_path)))
    assert "points of 1 m (the paper's: 0.1 m), sensor range 11 m (calibrated for points of" in said
    assert "8 runs to make; 1 at a time, " in said
    assert "Table 2: open field, 3 holonomic robots, vector sum; 2 seeds" in said
    assert "assumed: no dilatation" in said
    assert "set: duration = 20" in said
    assert "paper 80.7 s, x " in said
    for number, value in ((2, 80.7), (3, 90.0)):
        says = json.loads((tmp_path / f"table_{number}.json").read_text())
        assert (says["table"], says["point"], says["sensor_range"]) == (number, 1.0, 11.0)
        cells = [(cell["row"], cell["column"], cell["seeds"]) for cell in says["cells"]]
        assert cells == [("f3", "g3", 2), ("f3", "g4", 2)]
        assert says["cells"][1]["paper"] == value
        rows = list(csv.DictReader((tmp_path / f"table_{number}.csv").read_text().splitlines()))
        assert float(rows[1]["mean"]) == says["cells"][1]["mean"]
        with Image.open(tmp_path / f"table_{number}.png") as picture:
            assert min(picture.size) > 300
        assert "<svg" in (tmp_path / f"table_{number}.svg").read_text()[:1000]
    assert json.loads((tmp_path / "fit.json").read_text())["near"]["cells"] == 4
    assert json.loads((tmp_path / "orderings.json").read_text())[0]["pairs"] == 2
    said = output(run(*TABLE, "2", *part, *QUICK, "--out", str(tmp_path)))
    assert "0 runs made" in said


@pytest.mark.processes
def test_calibration_prints_each_radius_s_fit(tmp_path: Path, run: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    few = {number: paper().table(number).part(["f3", "f4"], ["g4"]) for number in (2, 3)}
    monkeypatch.setitem(paper().tables, 2, few[2])
    monkeypatch.setitem(paper().tables, 3, few[3])
    said = output(run("reproduce", "calibrate", "--ranges", "10,30", *QUICK, "--out", str(tmp_path)))
    assert "Tables 2 and 3 on points of 1 m" in said
    says = json.loads((tmp_path / "calibration.json").read_text())
    assert [one["radius"] for one in says["fits"]] == [10.0, 30.0]
    assert says["fits"][0]["near"]["cells"] == 4
    assert f"best: {says['radius']:g} m" in said


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["table", "9"], "table 9: no such table; choose from 2 to 8"),
        (["table", "two"], "N... two: expected a whole number"),
        (["table", "2", "--point", "0"], "--point 0: expected"),
        (["table", "2", "--point", "nan"], "--point NaN: expected"),
        (["table", "2", "--sensor-range", "-3"], "--sensor-range -3: expected"),
        (["table", "2", "--duration", "0.1"], "duration"),
        (["table", "2", "--seeds", "0"], "seeds = 0"),
        (["table", "2", "--cluster", "nowhere"], "cluster = nowhere: cannot be reached"),
        (["calibrate", "--ranges", "ten"], "--ranges = ten: expected numbers"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(run: Command, words: list[str], problem: str) -> None:
    refuses(run("reproduce", *words, "--out", "out"), problem, at_once="--cluster" not in words)


def test_a_grid_on_a_terminal_marks_what_is_far_off() -> None:
    setup = PaperSetup(0.5, 12.0, (1, 2))
    table = paper().table(7)
    plan = plan_of([table], {"": setup})
    outcome = outcome_of(plan, lambda _, seed: {"mfow_mean_s": 173.3 + seed, "dead_end_percent": 6.6})
    console = Console(record=True, width=120, force_terminal=True, file=io.StringIO())
    paper_commands._print_comparison(console, compare(table, setup, outcome))
    shown = console.export_text()
    assert "5 cars, dead" in shown
    assert "(173.3)" in shown
    assert "×1.01" in shown
    assert "×0.69" in shown
    assert "!" not in shown.replace("×0.65 !", "")


def test_a_picture_that_cannot_be_written_is_bad_input(tmp_path: Path) -> None:
    setup = PaperSetup(0.5, 12.0, (1,))
    table = paper().table(7)
    plan = plan_of([table], {"": setup})
    (tmp_path / "file").touch()
    with pytest.raises(BadInput, match="choose another folder"):
        table_picture(compare(table, setup, SweepOutcome(plan, {}, 0, 0.0)), [tmp_path / "file" / "table_7.png"])
