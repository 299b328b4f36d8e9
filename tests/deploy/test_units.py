"""The service units call commands and options that exist."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

UNITS = sorted((Path(__file__).parents[2] / "deploy" / "systemd").glob("*.service"))


@pytest.mark.processes
@pytest.mark.parametrize("unit", UNITS, ids=lambda path: path.name)
def test_a_unit_starts_a_module_with_options_that_it_has(unit: Path) -> None:
    (line,) = re.findall(r"^ExecStart=.*/python -P -m (.+)$", unit.read_text(encoding="utf-8"), flags=re.MULTILINE)
    module, *words = line.split()
    shown = subprocess.run([sys.executable, "-P", "-m", module, "--help"], capture_output=True, text=True, check=True)
    for option in (word for word in words if word.startswith("--")):
        assert option in shown.stdout


def test_there_is_a_unit_for_each_process() -> None:
    assert [path.stem for path in UNITS] == ["fogwatch-agent@", "fogwatch-router", "fogwatch-world"]
