"""The tutorial's numbers are what its commands give, as it promises."""

import re
import shlex
from pathlib import Path

import pytest

from tests.docs.test_commands import ROOT, command_lines
from tests.docs.test_executed import run_in_here, write_files

TUTORIAL = ROOT / "docs" / "tutorial.md"


@pytest.mark.accept
def test_the_runs_of_the_tutorial_give_its_numbers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_files("docs/tutorial.md")
    said = ""
    for line in command_lines(TUTORIAL):
        if line.startswith("fogwatch run "):
            said += run_in_here(shlex.split(f"{line} --in-process --no-picture --no-recording --no-report")[1:])
        elif line.startswith("fogwatch compare "):
            said += run_in_here(shlex.split(line)[1:])
    figures = r"^    ((?:MFoW|bounds|mean MFoW|largest MFoW|delivered) .*)$"
    shown = re.findall(figures, TUTORIAL.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(shown) == 5
    assert [line for line in shown if " ".join(line.split()) not in " ".join(said.split())] == []
