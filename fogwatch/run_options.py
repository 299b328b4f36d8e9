"""The options of a run, which the command line and Python read: what they change of its scenario, and how it is run."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from fogwatch.cli.options import FIELDS, option
from fogwatch.presets import PRESETS, chosen_settings
from patrol.errors import BadInput
from patrol.pose import MODELS
from patrol.scenario import parse_overrides
from patrol.scenario.patrols import PATROLS, PRICES

MOST_THREADS = 64

_PATROL = f"{PRICES}. Short for --set patrol.policy={'|'.join(patrol.policy for patrol in PATROLS.values())}."
_PRESET = f"{'; '.join(map(': '.join, PRESETS.items()))}. Other options and --set hold over it."
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


@dataclass(frozen=True)
class Changes:
    """Settings of a scenario that a run changes."""

    robots: Annotated[int | None, _of_robots("N", "Number of robots.")] = None
    spare: Annotated[
        int | None, _of_robots("N", "Robots that may join during the run (default: 2 with a live page, else 0).")
    ] = None
    body: Body = Body()
    start: Annotated[
        list[str] | None,
        _of_robots("X,Y", "Start of the next robot in m; X,Y,HEADING gives the heading too, in rad. Repeatable."),
    ] = None
    duration: Annotated[float | None, _of_run("S", "Simulated time in s.")] = None
    seed: Annotated[int | None, _of_run("K", "Random seed.")] = None
    pace: Annotated[
        str | None,
        _of_run("lockstep|realtime|X", "As fast as possible, in real time, or X times as fast as real time."),
    ] = None
    point: Annotated[float | None, _of_run("M", "Side of one grid point in m.")] = None
    patrol: Annotated[str | None, patrol_option("Run")] = None
    preset: Annotated[str | None, _of_run("|".join(PRESETS), _PRESET)] = None
    settings: Annotated[list[str] | None, settings_option(_SET, "Run")] = None

    def overrides(self) -> dict[str, object]:
        """Return all but the spare robots as overrides, by dotted field of the scenario."""
        robot_options = {"robots": self.robots, "start": [_read_start(text) for text in self.start or ()] or None}
        timing = {name: getattr(self, name) for name in ("duration", "seed", "pace", "point")}
        return overrides_of(self.settings, self.patrol, self.preset, **robot_options, **vars(self.body), **timing)


@dataclass(frozen=True)
class RunChoices:
    """Options of making a run, and of the files that it leaves."""

    out: Annotated[Path | None, _of_output("DIR", "Run folder, new or empty (default: runs/NAME-TIME).")] = None
    in_process: Annotated[
        bool, _of_run("", "Run in one process, without Zenoh; the trace is the same.", "--in-process")
    ] = False
    threads: Annotated[
        int,
        _of_run(
            "N", "Robots that decide at once with --in-process; more than 1 is seldom faster.", min=1, max=MOST_THREADS
        ),
    ] = 1
    port: Annotated[int | None, _of_run("N", "TCP port of the router (default: a free one).")] = None
    recovery: Annotated[
        bool, _of_run("", "Run the scenario without its faults as well, to judge the recovery.", "--recovery")
    ] = False
    page: Annotated[
        bool,
        _of_output(
            "", "Serve a live page while the processes run (never with --in-process or --quiet).", "--page/--no-page"
        ),
    ] = True
    picture: Annotated[bool, _of_output("", "Draw fog.png at the end.", "--picture/--no-picture")] = True
    recording: Annotated[bool, _of_output("", "Write recording.mcap at the end.", "--recording/--no-recording")] = True
    report: Annotated[bool, _of_output("", "Write report.html at the end.", "--report/--no-report")] = True

    def __post_init__(self) -> None:
        """Raise BadInput for a port that is none, and for threads that nothing uses."""
        if self.port is not None and not 0 < self.port < 65536:
            raise BadInput(f"--port {self.port}: is not a TCP port; give one from 1 to 65535")
        if self.threads > 1 and not self.in_process:
            raise BadInput(
                f"--threads {self.threads}: each robot is a process of its own; leave it out, or give --in-process"
            )


def overrides_of(
    settings: list[str] | None, patrol: str | None = None, preset: str | None = None, **options: object
) -> dict[str, object]:
    """Return what options change of a scenario, by dotted field: those of `FIELDS`, and ``--set``, ``--patrol``, ..."""
    by_field = {FIELDS[name]: value for name, value in options.items() if value is not None}
    return chosen_settings({**by_field, **parse_overrides(settings or [])}, patrol, preset)


def _read_start(text: str) -> list[float]:
    """Read a start: X,Y or X,Y,HEADING."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3):
        raise BadInput(f"--start {text}: expected X,Y or X,Y,HEADING in m and rad, for example --start 12.5,40")
    return numbers
