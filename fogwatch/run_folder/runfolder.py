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
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from patrol.errors import BadInput
from patrol.files.whole_file import write_whole
from patrol.prepare import terrain_of
from patrol.scenario import Scenario, load_scenario
from patrol.scenario.load import FILE as SCENARIO
from patrol.scenario.load import keep_scenario
from patrol.scenario.sections import MAP
from patrol.security.access import FILE as ACCESS
from patrol.summary.model import Summary

RUNS = Path("runs")


class PolicyNotMade(BadInput):
    """A policy that raised before the run began; the run's folder is kept, since it holds the traceback."""

    def __init__(self, why: str, log: Path) -> None:
        """Say in one line what was raised, and where the traceback is."""
        super().__init__(f"{why}; the traceback is in {log}")


@dataclass(frozen=True, slots=True)
class RunFolder:
    """The paths in a run folder."""

    path: Path
    made: bool = False  # by this run

    @property
    def scenario(self) -> Path:
        """The resolved scenario."""
        return self.path / SCENARIO

    @property
    def journal(self) -> Path:
        """The journal, which the world writes."""
        return self.path / "journal"

    @property
    def ticks(self) -> Path:
        """The table of ticks, one line per tick."""
        return self.path / "ticks.csv"

    @property
    def summary(self) -> Path:
        """The measures and the verdict."""
        return self.path / "summary.json"

    @property
    def picture(self) -> Path:
        """The picture of the final fog."""
        return self.path / "fog.png"

    @property
    def recording(self) -> Path:
        """The recording for robot viewers."""
        return self.path / "recording.mcap"

    @property
    def report(self) -> Path:
        """The report."""
        return self.path / "report.html"

    @property
    def static(self) -> Path:
        """Static fields for the processes; removed when the run ends."""
        return self.path / "static"

    @property
    def access(self) -> Path:
        """The control file of the running fleet."""
        return self.path / ACCESS

    @property
    def logs(self) -> Path:
        """The folder of the processes' output."""
        return self.path / "logs"

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
        try:
            path.mkdir(parents=True)
        except FileExistsError as error:
            if out is None and path.exists():
                continue  # another run has taken the name meanwhile
            if not path.is_dir():
                raise _unusable_error(path, out, error) from None
            if not _is_empty(path, out):
                raise BadInput(
                    f"--out {out}: is not empty; choose a folder that is, or that does not exist yet"
                ) from None
            return RunFolder(path)
        except OSError as error:
            raise _unusable_error(path, out, error) from None
        return RunFolder(path, made=True)


def fill(folder: RunFolder, scenario: Scenario, out: Path | None) -> None:
    """Copy the scenario, with all files that it names, into the folder of a new run.

    `out` is the folder that was asked for, as errors name it.
    """
    try:
        keep_scenario(scenario, folder.path)
    except OSError as error:
        raise _unusable_error(folder.path, out, error) from None


def _is_empty(path: Path, out: Path | None) -> bool:
    try:
        return not any(path.iterdir())
    except OSError as error:
        raise _unusable_error(path, out, error) from None


def _unusable_error(path: Path, out: Path | None, error: OSError) -> BadInput:
    name = f"--out {out}" if out else path
    return BadInput(f"{name}: cannot be written ({error.strerror}); choose another folder")


def untaken(first: Path) -> Path:
    """Return a path that does not exist yet: the first, or else one with a number appended."""
    path = first
    number = 2
    while path.exists():
        path = first.with_name(f"{first.name}-{number}")
        number += 1
    return path


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
        moved_folder = replace(folder, path=moved)
        moved_folder.access.unlink(missing_ok=True)
        return moved_folder
    finally:
        os.close(handle)
