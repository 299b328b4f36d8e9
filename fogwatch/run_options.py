"""The options of a run, which the command line and Python read.

Presets, and others that change its scenario (`Changes`); and how it is run (`RunChoices`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from fogwatch.cli.options import FIELDS, option
from patrol.errors import BadInput
from patrol.extras import study
from patrol.pose import MODELS, TURNS_IN_ARCS
from patrol.scenario import Scenario, parse_overrides
from patrol.scenario.patrols import PATROLS, PRICES, patrol_settings

_POINTS = "on points of 0.5 m (the paper's: 0.1 m)"

PRESETS: Mapping[str, str] = {
    "paper": f"the paper's algorithm, bodies and sensor, with rules of ours where it is open or fails, {_POINTS}",
    "letter": f"the paper without our additions, each rule as printed, random steps for cars too, {_POINTS}",
}
"""The presets by name, and what each is."""


def preset_settings(name: str | None) -> dict[str, object]:
    """Return the settings of a preset, by dotted field of the scenario; None has no settings.

    They are those that all cells of the paper's tables share, for any terrain and team.
    """
    if name is None:
        return {}
    if name not in PRESETS:
        raise BadInput(f"preset {name}: no such preset; choose from {', '.join(PRESETS)}")
    from patrol.scenario.policies import TO_THE_LETTER

    paper = study("paper.printed").paper

    return {**paper().settings, **(TO_THE_LETTER if name == "letter" else {})}


def chosen_settings(overrides: Mapping[str, object], patrol: str | None, preset: str | None) -> dict[str, object]:
    """Return overrides, by dotted field, with the settings of a preset, over which they hold, and of a named patrol."""
    settings = {**preset_settings(preset), **overrides}
    return settings | patrol_settings(patrol, settings)


MOST_WORKERS = 64

_PATROL = f"{PRICES}. Short for --set patrol.policy={'|'.join(patrol.policy for patrol in PATROLS.values())}."
_PRESET = f"{'; '.join(map(': '.join, PRESETS.items()))}. Other options and --set hold over it."
_SPARE = "Robots that may join during the run (default: 2 with a live page, else 0)."
_START = "Start of the next robot in m; X,Y,HEADING gives the heading too, in rad. Repeatable."
_PACE = "As fast as possible, in real time, or X times as fast as real time."
_IN_PROCESS = "Run in one process, without Zenoh; the trace is the same."
_WORKERS = "Processes for the robots' decisions with --in-process; faster from about 100 robots."
_RECOVERY = "Run the scenario without its faults as well, to judge the recovery."
_PAGE = "Serve a live page while the processes run (never with --in-process or --quiet)."
_SET = "Set any field of the scenario, such as patrol.options.separation=none. Repeatable."

_of_robots, _of_run, _of_output = (partial(option, panel=panel) for panel in ("Robots", "Run", "Output"))


def settings_option(text: str, panel: str | None = None) -> Any:
    """Return the option ``--set`` of a command."""
    return option("FIELD=VALUE", text, "--set", panel=panel)


def patrol_option(panel: str | None = None) -> Any:
    """Return the option ``--patrol`` of a command."""
    return option("|".join(PATROLS), _PATROL, panel=panel)


@dataclass(frozen=True)
class Body:
    """The body and the sensor of all robots."""

    model: Annotated[str | None, _of_robots("|".join(MODELS), "Body model.")] = None
    radius: Annotated[float | None, _of_robots("M", "Body radius in m.")] = None
    speed: Annotated[float | None, _of_robots("M/S", "Top speed in m/s.")] = None
    turning_radius: Annotated[float | None, _of_robots("M", "Tightest turn of a car, in m.")] = None
    sensor_range: Annotated[float | None, _of_robots("M", "Range of the sensor in m.")] = None

    def check(self, scenario: Scenario) -> None:
        """Raise BadInput for an option that has no effect on any robot of a scenario."""
        if self.turning_radius is not None and not any(spec.model in TURNS_IN_ARCS for spec in scenario.roster):
            what = f"--turning-radius {self.turning_radius:g}: has an effect only on cars, and no robot is one"
            raise BadInput(f"{what}; give --model car as well, or leave it out")


@dataclass(frozen=True)
class Changes:
    """Settings of a scenario that a run changes."""

    robots: Annotated[int | None, _of_robots("N", "Number of robots.")] = None
    spare: Annotated[int | None, _of_robots("N", _SPARE)] = None
    body: Body = Body()
    start: Annotated[list[str] | None, _of_robots("X,Y", _START)] = None
    duration: Annotated[float | None, _of_run("S", "Simulated time in s.")] = None
    seed: Annotated[int | None, _of_run("K", "Random seed.")] = None
    pace: Annotated[str | None, _of_run("lockstep|realtime|X", _PACE)] = None
    point: Annotated[float | None, _of_run("M", "Side of one grid point in m.")] = None
    patrol: Annotated[str | None, patrol_option("Run")] = None
    preset: Annotated[str | None, _of_run("|".join(PRESETS), _PRESET)] = None
    settings: Annotated[list[str] | None, settings_option(_SET, "Run")] = None

    def overrides(self) -> dict[str, object]:
        """Return all but the spare robots as overrides, by dotted field of the scenario."""
        robot_options = {"robots": self.robots, "start": [read_start(text) for text in self.start or ()] or None}
        timing = {name: getattr(self, name) for name in ("duration", "seed", "pace", "point")}
        return overrides_of(self.settings, self.patrol, self.preset, **robot_options, **vars(self.body), **timing)


@dataclass(frozen=True)
class RunChoices:
    """Options of making a run, and of the files that it leaves."""

    out: Annotated[Path | None, _of_output("DIR", "Run folder, new or empty (default: runs/NAME-TIME).")] = None
    in_process: Annotated[bool, _of_run("", _IN_PROCESS, "--in-process")] = False
    workers: Annotated[int, _of_run("N", _WORKERS)] = 1
    port: Annotated[int | None, _of_run("N", "TCP port of the router (default: a free one).")] = None
    recovery: Annotated[bool, _of_run("", _RECOVERY, "--recovery")] = False
    page: Annotated[bool, _of_output("", _PAGE, "--page/--no-page")] = True
    picture: Annotated[bool, _of_output("", "Draw fog.png at the end.", "--picture/--no-picture")] = True
    recording: Annotated[bool, _of_output("", "Write recording.mcap at the end.", "--recording/--no-recording")] = True
    report: Annotated[bool, _of_output("", "Write report.html at the end.", "--report/--no-report")] = True

    def __post_init__(self) -> None:
        """Raise BadInput for a port that is none, and for workers that nothing uses."""
        if self.port is not None and not 0 < self.port < 65536:
            raise BadInput(f"--port {self.port}: is not a TCP port; give one from 1 to 65535")
        if not 1 <= self.workers <= MOST_WORKERS:
            raise BadInput(f"--workers {self.workers}: expected 1 to {MOST_WORKERS}")
        if self.workers > 1 and not self.in_process:
            why = "each robot is a process of its own"
            raise BadInput(f"--workers {self.workers}: {why}; leave it out, or give --in-process")


def overrides_of(
    settings: list[str] | None, patrol: str | None = None, preset: str | None = None, **options: object
) -> dict[str, object]:
    """Return what options change of a scenario, by dotted field: those of `FIELDS`, and ``--set``, ``--patrol``, ..."""
    by_field = {FIELDS[name]: value for name, value in options.items() if value is not None}
    return chosen_settings({**by_field, **parse_overrides(settings or [])}, patrol, preset)


def read_start(text: str) -> list[float]:
    """Read a start: X,Y or X,Y,HEADING."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3) or not all(map(math.isfinite, numbers)):
        raise BadInput(f"--start {text}: expected X,Y or X,Y,HEADING in m and rad, for example --start 12.5,40")
    return numbers
