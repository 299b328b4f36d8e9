"""The run folder: everything a run leaves, and enough of what it was given to run it again.

    scenario.yaml  resolved; `fogwatch run FOLDER/scenario.yaml` repeats the run
    map/           a copy of the map, when there is one
    journal        the world's own record (`patrol.journal.file`)
    ticks.csv      one line a tick
    summary.json   what it adds up to, and the verdict
    fog.png        the final fog and the robots' paths
    recording.mcap the same for Foxglove, Lichtblick, Rerun and PlotJuggler
    report.html    what happened, on one page
    timeline.yaml  the scenario with what operators did to it; run it for the same trace
    control.json   where a running fleet is met, and the right to control it; gone when the run is over
    logs/          what each process printed, if there was more than one

A run whose world was started by hand leaves the same but for what only the launcher makes: pictures, recording, report
and logs.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from patrol.errors import BadInput
from patrol.ground.maps import load_terrain
from patrol.net.access import FILE as ACCESS
from patrol.scenario import Scenario, load_scenario
from patrol.scenario.copying import FILE as SCENARIO
from patrol.scenario.copying import keep_scenario

RUNS = Path("runs")


@dataclass(frozen=True, slots=True)
class RunFolder:
    """The places in a run folder. made: whether the folder was not there before."""

    path: Path
    made: bool = False

    @property
    def scenario(self) -> Path:
        """The resolved scenario."""
        return self.path / SCENARIO

    @property
    def journal(self) -> Path:
        """The world's record."""
        return self.path / "journal"

    @property
    def ticks(self) -> Path:
        """One line a tick."""
        return self.path / "ticks.csv"

    @property
    def summary(self) -> Path:
        """What it adds up to."""
        return self.path / "summary.json"

    @property
    def picture(self) -> Path:
        """The final fog."""
        return self.path / "fog.png"

    @property
    def recording(self) -> Path:
        """For robot viewers."""
        return self.path / "recording.mcap"

    @property
    def report(self) -> Path:
        """What happened, on one page."""
        return self.path / "report.html"

    @property
    def static(self) -> Path:
        """Static fields for the processes; gone when the run is over."""
        return self.path / "static"

    @property
    def access(self) -> Path:
        """Where the fleet is met and the right to control it, while it runs."""
        return self.path / ACCESS

    @property
    def logs(self) -> Path:
        """What the processes printed."""
        return self.path / "logs"

    def log(self, name: str) -> Path:
        """What one process printed."""
        return self.logs / f"{name}.log"

    def load(self) -> Scenario:
        """The scenario, as every process of the run reads it."""
        return load_scenario(self.scenario)

    def write_summary(self, summary: Mapping[str, Any]) -> None:
        """Write summary.json."""
        self.summary.write_text(f"{json.dumps(summary, indent=2)}\n", encoding="utf-8")

    def discard(self) -> None:
        """Take everything away again: the run could not begin."""
        for entry in self.path.iterdir():
            if entry.is_dir():
                shutil.rmtree(entry, ignore_errors=True)
            else:
                entry.unlink(missing_ok=True)
        if self.made:
            self.path.rmdir()


def create(scenario: Scenario, out: Path | None, now: datetime) -> RunFolder:
    """Make the folder of a new run: `out`, or ``runs/<name>-<time>``.

    Raises BadInput when it is not empty or cannot be written to.
    """
    path = (out or untaken(RUNS / f"{scenario.name}-{now:%Y%m%d-%H%M%S}")).absolute()
    shown = f"--out {out}" if out else str(path)
    folder = RunFolder(path, made=not path.exists())
    if scenario.terrain.map is not None:
        # A map that cannot be used is told by its own name, not by its copy's, and leaves no folder behind.
        load_terrain(scenario.terrain, scenario.point, scenario.base)
    try:
        if path.is_dir() and any(path.iterdir()):
            raise BadInput(f"{shown}: is not empty; choose a folder that is, or that does not exist yet")
        path.mkdir(parents=True, exist_ok=True)
        keep_scenario(scenario, path)
    except OSError as error:
        raise BadInput(f"{shown}: cannot be written ({error.strerror}); choose another folder") from None
    return folder


def untaken(first: Path) -> Path:
    """A path where there is nothing yet: this one, or with a number after it."""
    path = first
    number = 2
    while path.exists():
        path = first.with_name(f"{first.name}-{number}")
        number += 1
    return path
