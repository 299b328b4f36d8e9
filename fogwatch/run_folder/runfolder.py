"""The run folder: all files that a run leaves, with enough of its input to repeat it.

    scenario.yaml  resolved; `fogwatch run FOLDER/scenario.yaml` repeats the run
    map/           a copy of the map, when there is one
    journal        the world's own record (`patrol.journal.file`)
    ticks.csv      one line per tick
    summary.json   the measures and the verdict
    fog.png        the final fog and the robots' paths
    recording.mcap the run for Foxglove, Lichtblick, Rerun and PlotJuggler
    report.html    what happened, on one page
    timeline.yaml  the scenario with all that operators did; it repeats the run with the same trace
    control.json   address of a running fleet, and the name of its private folder; removed when the run ends
    logs/          output of each process, if there was more than one

A run whose world was started by hand leaves the same files, except those that only the launcher makes: pictures,
recording, report and logs.
"""

from __future__ import annotations

import json
import os
import shutil
import traceback
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from itertools import chain, count
from pathlib import Path

from patrol.errors import BadInput
from patrol.files.whole_file import write_whole, writing
from patrol.prepare import terrain_of
from patrol.scenario import Scenario, load_scenario
from patrol.scenario.load import FILE as SCENARIO
from patrol.scenario.load import keep_scenario
from patrol.scenario.sections import MAP
from patrol.summary.model import Summary
from runtime.security.access import FILE as ACCESS

RUNS = Path("runs")


class PolicyNotMade(BadInput):
    """A policy that raised before the run began; the run's folder is kept, since it holds the traceback."""

    def __init__(self, why: str, log: Path) -> None:
        """Say in one line what was raised, and where the traceback is."""
        super().__init__(f"{why}; the traceback is in {log}")


class RunFolder:
    """The paths in a run folder; `made` is True if this run has made it."""

    def __init__(self, path: Path, made: bool = False) -> None:
        self.path, self.made = path, made
        self.scenario = path / SCENARIO
        self.journal = path / "journal"
        self.ticks = path / "ticks.csv"
        self.summary = path / "summary.json"
        self.picture = path / "fog.png"
        self.recording = path / "recording.mcap"
        self.report = path / "report.html"
        self.static = path / "static"  # fields for the processes; removed when the run ends
        self.unfinished_static = path / "static.part"
        self.access = path / ACCESS
        self.logs = path / "logs"

    def log(self, name: str) -> Path:
        """Return the file for the output of one process, by the log's name without its ending."""
        return self.logs / f"{name}.log"

    def robot_log(self, name: str) -> Path:
        """Return the log of a robot, whose mind may be in this process or its own."""
        return self.log(f"robot-{name}")

    def keep_failure(self, name: str, reason: str, error: BaseException | None) -> Path:
        """Append to a robot's log how its policy has failed in this process, and return the log.

        The robot's own process does the same. `error` is None where the policy raised nothing.
        """
        log = self.robot_log(name)
        raised = "" if error is None else "".join(traceback.format_exception(error))
        with suppress(OSError):  # the verdict has the reason
            log.parent.mkdir(exist_ok=True)
            with log.open("a", encoding="utf-8", errors="backslashreplace") as file:
                file.write(f"{raised}{name}: {reason}\n")
        return log

    def load(self) -> Scenario:
        """Read the scenario, as every process of the run does."""
        return load_scenario(self.scenario)

    def write_summary(self, summary: Summary) -> None:
        """Write summary.json."""
        write_whole(self.summary, f"{json.dumps(summary.document(), indent=2)}\n")

    def naming_the_given_map(self, error: str, scenario: Scenario) -> str:
        """Return an error with the given map's name in place of that of its copy in this folder."""
        if scenario.terrain.map is None:
            return error
        original = scenario.base / scenario.terrain.map
        return error.replace(str(self.path / MAP / original.name), str(original))

    def discard(self) -> None:
        """Remove all files again, since the run could not begin; the folder too, if this run made it."""
        for entry in self.path.iterdir():
            if entry.is_dir():
                shutil.rmtree(entry, ignore_errors=True)
            else:
                entry.unlink(missing_ok=True)
        if self.made:
            self.path.rmdir()


def make_folder(scenario: Scenario, out: Path | None, now: datetime) -> RunFolder:
    """Make the folder of a new run, which no other run takes then.

    Nothing is in it yet. `out` must be new or empty; None for ``runs/<name>-<time>``.
    """
    if scenario.terrain.map is not None:
        # Loaded here so that an error names the map itself, not its copy, and leaves no folder behind.
        terrain_of(scenario)
    while True:
        path = (out or untaken(RUNS / f"{scenario.name}-{now:%Y%m%d-%H%M%S}")).absolute()
        with writing(f"--out {out}" if out else path, "choose another folder"):
            try:
                path.mkdir(parents=True)
            except FileExistsError:
                if out is None and path.exists():
                    continue  # another run has taken the name meanwhile
                if not path.is_dir():
                    raise
                if any(path.iterdir()):
                    remedy = "choose a folder that is, or that does not exist yet"
                    raise BadInput(f"--out {out}: is not empty; {remedy}") from None
                return RunFolder(path)
            return RunFolder(path, made=True)


def fill(folder: RunFolder, scenario: Scenario, out: Path | None) -> None:
    """Copy the scenario, with all files that it names, into the folder of a new run.

    `out` is the folder that was asked for, as errors name it.
    """
    with writing(f"--out {out}" if out else folder.path, "choose another folder"):
        keep_scenario(scenario, folder.path)


def untaken(first: Path) -> Path:
    """Return a path that does not exist yet: the first, or else one with a number appended."""
    paths = chain([first], (first.with_name(f"{first.name}-{number}") for number in count(2)))
    return next(path for path in paths if not path.exists())


def found_again(folder: RunFolder, handle: int, say: Callable[[str], None]) -> RunFolder:
    """Find the run's folder, which may have been moved; the same object unless it was.

    `handle` is the folder's descriptor, open since the run began; this closes it.
    """
    try:
        if folder.path.exists():
            return folder
        try:
            moved = Path(f"/proc/self/fd/{handle}").readlink()
        except OSError:  # a system without proc(5)
            moved = folder.path
        if not moved.is_dir():
            say(f"{folder.path}: the run's folder was moved away or deleted, with all that it held")
            return folder
        say(f"{folder.path}: the run's folder was moved to {moved}; the summary is written there")
        moved_folder = RunFolder(moved, folder.made)
        moved_folder.access.unlink(missing_ok=True)
        return moved_folder
    finally:
        os.close(handle)
