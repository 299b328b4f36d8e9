"""The folder of a run whose world was started by hand: it gets all that the run can be read, and run again, with."""

from __future__ import annotations

import os
from pathlib import Path

from patrol.errors import BadInput
from patrol.scenario import Scenario
from patrol.scenario.copying import FILE, MAP, keep_scenario


def check(scenario: Path, out: Path) -> None:
    """Make the folder, unless it is there. BadInput when it cannot be written to or holds anything of another run."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        taken = any((out / name).exists() for name in ("journal", "ticks.csv"))
        others = [name for name in (FILE, MAP) if (out / name).exists() and not _is_in(out, scenario)]
    except OSError as error:
        raise BadInput(f"--out {out}: cannot be written ({error.strerror}); choose another folder") from None
    if taken:
        raise BadInput(f"--out {out}: holds a run already; choose another folder")
    if others:
        raise BadInput(f"--out {out}: holds {others[0]}, which is not this run's; choose another folder")
    if not os.access(out, os.W_OK):
        raise BadInput(f"--out {out}: cannot be written; choose another folder")


def keep(scenario: Scenario, file: Path, out: Path) -> None:
    """Keep the scenario that was read from a file in the folder, unless the file is the folder's own."""
    if _is_in(out, file):
        return
    try:
        keep_scenario(scenario, out)
    except OSError as error:
        raise BadInput(f"--out {out}: cannot be written ({error.strerror}); choose another folder") from None


def _is_in(out: Path, scenario: Path) -> bool:
    return scenario.resolve() == (out / FILE).resolve()
