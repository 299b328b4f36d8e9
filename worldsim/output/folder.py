"""The folder of a run without a launcher: it gets all that is needed to read the run, and to repeat it."""

from __future__ import annotations

import os
from pathlib import Path

from patrol.errors import BadInput
from patrol.files.whole_file import writing
from patrol.scenario import Scenario
from patrol.scenario.load import FILE, keep_scenario
from patrol.scenario.sections import MAP


def check(scenario: Path, out: Path) -> None:
    """Make the run's folder unless it is there, and refuse one that holds files of another run.

    The scenario's file may lie in it.
    """
    with writing(f"--out {out}", "choose another folder"):
        out.mkdir(parents=True, exist_ok=True)
        is_taken = any((out / name).exists() for name in ("journal", "ticks.csv"))
        # The scenario may have been read from the folder itself.
        foreign = [name for name in (FILE, MAP) if (out / name).exists() and not _is_in(out, scenario)]
    if is_taken:
        raise BadInput(f"--out {out}: already holds a run; choose another folder")
    if foreign:
        raise BadInput(f"--out {out}: holds {foreign[0]}, which belongs to another run; choose another folder")
    if not os.access(out, os.W_OK):
        raise BadInput(f"--out {out}: cannot be written; choose another folder")


def keep(scenario: Scenario, file: Path, out: Path) -> None:
    """Copy the scenario into the folder, unless it was read from there."""
    if not _is_in(out, file):
        with writing(f"--out {out}", "choose another folder"):
            keep_scenario(scenario, out)


def _is_in(out: Path, scenario: Path) -> bool:
    return scenario.resolve() == (out / FILE).resolve()
