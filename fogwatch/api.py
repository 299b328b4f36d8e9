"""Run a scenario from Python: `fogwatch.run(scenario)`, in this process or as a fleet of processes."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fogwatch.launch.live_table import Show, Silent
from fogwatch.launch.runfolder import RunFolder, create
from patrol.errors import BadInput
from patrol.net.telemetry import Metrics, Notice, Watcher
from patrol.process.warmup import warm
from patrol.radio.fleet_key import fleet_key
from patrol.scenario import Scenario, load_scenario, open_scenario
from patrol.scenario.controls import prepared_as_operated

if TYPE_CHECKING:
    from fogwatch.launch.launcher import Launch
    from patrol.journal import Event, TickRecord
    from patrol.prepare import Prepared
    from worldsim.run_record import RunRecord
    from worldsim.verdict.judge import Verdict

MOST_THREADS = 8
EAGER = 16
"""Fleets up to this size are spawned before it is known that they fit, so that their start takes less time."""
PROCESS_GB = 0.15
"""Memory of one agent's process."""
PACKAGES = ("patrol", "agent", "worldsim")


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """What a run came to.

    summary: as in summary.json. folder: where everything is. mfow_s: MFoW after each tick, s. interrupted: somebody
    stopped it before its end.
    """

    summary: Mapping[str, Any]
    folder: Path
    mfow_s: NDArray[np.float64]
    verdict: Verdict
    interrupted: bool = False

    @property
    def trace_hash(self) -> str:
        """One number for everything that happened; equal for equal runs, however they were run."""
        return str(self.summary["trace_hash"])

    def __repr__(self) -> str:
        mean, bound = self.summary["mfow_mean_s"], self.summary["bound_s"]
        mfow = "no ticks" if mean is None else f"MFoW mean {mean:.1f} s (bound {bound:.1f} s)"
        done = f"{self.summary['simulated_s']:g} s simulated{', interrupted' if self.interrupted else ''}"
        return f"<Result {self.summary['name']}: {mfow}, {done}, verdict {self.verdict.outcome}, in {self.folder}>"


@dataclass(frozen=True, slots=True)
class Wishes:
    """How a run is to be done, and who is told.

    port: of the router, or None for a free one. begin: called when the ticks are about to begin. stop: asked from then
    on whether to end early; urgent: whether to end by force. Before that KeyboardInterrupt ends everything. draw:
    whether to draw the final fog. recording, report: whether to write them when the run is over. recovery: whether to
    run the scenario without its faults too, in one process, to judge recovery by. page: whether to serve one while
    processes run.
    """

    out: Path | None = None
    in_process: bool = False
    port: int | None = None
    show: Show = field(default_factory=Silent)
    begin: Callable[[], None] = lambda: None
    stop: Callable[[], bool] = lambda: False
    urgent: Callable[[], bool] = lambda: False
    draw: bool = True
    recording: bool = False
    report: bool = False
    recovery: bool = False
    page: bool = False


def run(
    scenario: Scenario | Mapping[str, Any] | str | Path,
    *,
    out: str | Path | None = None,
    in_process: bool = True,
    progress: Callable[[Metrics], None] | None = None,
    overrides: Mapping[str, object] | None = None,
    recording: bool = False,
    report: bool = False,
    recovery: bool = False,
) -> Result:
    """Run a scenario to its end.

    scenario: a file, a map's YAML file, the name of a built-in terrain, a mapping shaped like a scenario file, or a
    loaded scenario. out: folder for what the run leaves, new or empty; ``runs/<name>-<time>`` unless given.
    in_process: in this process, or as one process per robot over Zenoh; both give the same trace. progress: called
    with the run so far, at most ten times a second. overrides: values by dotted field, ``{"patrol.dilatation": 0}``.
    recording, report: write recording.mcap and report.html into the run folder as well; `fogwatch record` and
    `fogwatch report` make them at any later time, so that a loop over many runs need not wait for them. recovery: run
    a scenario with faults without them too, so that the verdict can judge recovery.

    Raises BadInput, one line that says what is wrong; `fogwatch.launch.launcher.Failed` when processes could not be
    brought
    to run; KeyboardInterrupt after leaving everything in order.
    """
    if isinstance(scenario, Scenario):
        loaded = load_scenario(scenario.model_dump(mode="json", exclude_none=True), overrides)
    elif isinstance(scenario, Mapping):
        loaded = load_scenario(scenario, overrides)
    else:
        loaded = open_scenario(str(scenario), overrides)
    show = Silent() if progress is None else _Calling(progress)
    where = None if out is None else Path(out)
    wishes = Wishes(where, in_process, show=show, recording=recording, report=report, recovery=recovery)
    return execute(loaded, wishes)


def execute(scenario: Scenario, wishes: Wishes) -> Result:
    """Run a loaded scenario as wished.

    Raises BadInput, and `fogwatch.launch.launcher.Failed` when no fleet would run.
    """
    warm((*PACKAGES, "monitor") if wishes.recording or wishes.report else PACKAGES, wishes.show.say)
    folder = create(scenario, wishes.out, datetime.now().astimezone())
    try:
        resolved = folder.load()
        fleet_key(resolved)  # whether it can be read is better known before there are processes
        return (_in_this_process if wishes.in_process else _as_processes)(resolved, folder, wishes)
    except (BadInput, KeyboardInterrupt):
        if not folder.journal.exists():  # what has run is kept, whatever is wrong with it
            folder.discard()
        raise
    finally:
        wishes.show.close()


def _begin(wishes: Wishes) -> None:
    """The ticks are about to begin, unless somebody has wanted an end before."""
    wishes.begin()
    if wishes.stop():
        raise KeyboardInterrupt


def _in_this_process(scenario: Scenario, folder: RunFolder, wishes: Wishes) -> Result:
    from experiments.inprocess import run_in_process
    from patrol.prepare import prepare
    from worldsim.output.ticks_table import TicksTable

    prepared = prepare(scenario)
    _announce(scenario, folder, wishes)
    names = {spec.number: spec.name for spec in scenario.roster}
    points = int(np.count_nonzero(prepared.patrolled))
    watcher = Watcher(names, points, scenario.step, scenario.ticks, time.monotonic)
    _begin(wishes)
    baseline_s = _baseline(prepared, wishes)
    with closing(TicksTable(folder.ticks, scenario.step)) as table:

        def on_tick(record: TickRecord) -> None:
            table.tick(record)
            metrics = watcher.take(record)
            if metrics is not None:
                wishes.show.metrics(metrics)

        def on_event(event: Event) -> None:
            wishes.show.notice(watcher.notice(event))

        outcome = run_in_process(
            prepared,
            journal=folder.journal,
            started=datetime.now(UTC).isoformat(timespec="seconds"),
            progress=on_tick,
            events=on_event,
            stop=wishes.stop,
            threads=min(len(names), os.cpu_count() or 1, MOST_THREADS),
            baseline_s=baseline_s,
        )
    return _result(folder, prepared, outcome.journal, outcome.verdict, outcome.summary, wishes)


def _as_processes(scenario: Scenario, folder: RunFolder, wishes: Wishes) -> Result:
    from fogwatch.launch.launcher import WORLD, Failed, Launch
    from patrol.prepare import prepare
    from worldsim.timeline import Timeline

    names = [spec.name for spec in scenario.roster]
    _check_memory(len(names) - len(scenario.spares))
    prepared = prepare(scenario) if len(names) > EAGER else None
    fleet = f"{scenario.name}-{os.urandom(4).hex()}"
    absent = [names[number - 1] for number in Timeline(scenario).starts_absent]
    launch = Launch(folder, fleet, names, wishes.show, wishes.stop, wishes.port, wishes.urgent, absent, wishes.page)
    try:
        launch.start()
        prepared = prepared or prepare(scenario)
        _announce(scenario, folder, wishes)
        _write_static(prepared, _unfinished(folder.static))
        _begin(wishes)
        _unfinished(folder.static).rename(folder.static)
        launch.watch()
    except BaseException:
        launch.interrupted = True
        raise
    finally:
        exit_codes = _finish(launch)
        for static in (folder.static, _unfinished(folder.static)):
            shutil.rmtree(static, ignore_errors=True)

    from patrol.journal import read_journal
    from worldsim.output.summary import summarise
    from worldsim.verdict.judge import judge

    if not folder.journal.exists():
        if launch.interrupted:
            raise KeyboardInterrupt
        raise Failed(launch.obituary(WORLD))
    if exit_codes[WORLD] != 0:
        wishes.show.say(launch.obituary(WORLD))
    try:
        journal = read_journal(folder.journal)
    except BadInput as bad:
        raise Failed(str(bad)) from None
    operated = prepared_as_operated(prepared, journal.events)
    verdict = judge(journal, exit_codes, prepared, baseline_s=_baseline(operated, wishes))
    wall_s = journal.end.notes.get("wall_s") if journal.end else None
    summary = {**summarise(journal, verdict, wall_s), "exit_codes": dict(exit_codes)}
    return _result(folder, operated, journal, verdict, summary, wishes)


def _announce(scenario: Scenario, folder: RunFolder, wishes: Wishes) -> None:
    """Say what begins, now that nothing is wrong with it."""
    count = len(scenario.roster) - len(scenario.spares)
    robots = "1 robot" if count == 1 else f"{count} robots"
    if scenario.spares:
        robots += f", {len(scenario.spares)} more to join,"
    wishes.show.say(f"{scenario.name}: {robots} for {scenario.duration:g} s; run folder {folder.path}")


def _baseline(prepared: Prepared, wishes: Wishes) -> float | None:
    """The fault-free mean MFoW (s), where it is wanted and one process can tell; that run needs no others."""
    scenario = prepared.scenario
    if not wishes.recovery or not scenario.faults or scenario.radio.via != "ether" or wishes.stop():
        return None
    from experiments.inprocess import fault_free_mfow

    wishes.show.say("running it without its faults, to judge recovery by ...")
    return fault_free_mfow(prepared, wishes.stop)


def _check_memory(robots: int) -> None:
    """Refuse a fleet of processes that this machine has no memory for, before it is brought down."""
    needed_gb = robots * PROCESS_GB
    there_gb = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 1e9
    if needed_gb > there_gb:
        raise BadInput(
            f"{robots} robots as processes need about {needed_gb:.0f} GB of memory and there are {there_gb:.0f}; use "
            "--in-process, or fewer robots"
        )


def _finish(launch: Launch) -> Mapping[str, int | None]:
    """End all processes; who is interrupted at that ends them by force."""
    try:
        return launch.finish()
    except KeyboardInterrupt:
        return launch.finish()


def _write_static(prepared: Prepared, part: Path) -> None:
    """Write the static fields for the processes, which go on as soon as the folder has its name."""
    from agent.bodies.refine import psi_field
    from agent.process import PSI

    prepared.save(part)
    patrol = prepared.scenario.patrol
    if patrol.avoidance == "goal-refinement":
        np.save(part / PSI, psi_field(prepared.terrain, patrol.refine_reach))


def _unfinished(static: Path) -> Path:
    """Where static fields are written until they are whole."""
    return static.with_suffix(".part")


def _result(
    folder: RunFolder,
    prepared: Prepared,
    journal: RunRecord,
    verdict: Verdict,
    summary: Mapping[str, Any],
    wishes: Wishes,
) -> Result:
    """Write the summary and what is derived from the journal."""
    from patrol.journal import Journal
    from worldsim.run_record import INTERRUPTED

    asked = wishes.stop()
    folder.write_summary(summary)
    step = prepared.scenario.step
    mfow_s = np.array([record.mfow for record in journal.ticks], dtype=np.float64) * step
    if wishes.draw and len(mfow_s) and not wishes.urgent():
        wishes.show.say("drawing the final fog ...")
        _draw(folder, prepared, wishes)
    if len(mfow_s) and isinstance(journal, Journal) and (wishes.recording or wishes.report):
        from fogwatch.launch.derived import derive

        wishes.show.say(f"writing {' and '.join(_derived(wishes))} ...")
        derive(
            journal,
            prepared,
            summary,
            folder.recording if wishes.recording else None,
            folder.report if wishes.report else None,
            # An interrupted run is told of as well; only who asks once more has no time for that.
            hurry=lambda: wishes.urgent() or (wishes.stop() and not asked),
            say=wishes.show.say,
        )
    interrupted = journal.end is not None and journal.end.reason == INTERRUPTED
    return Result(summary, folder.path, mfow_s, verdict, interrupted)


def _derived(wishes: Wishes) -> list[str]:
    return ["the recording"] * wishes.recording + ["the report"] * wishes.report


def _draw(folder: RunFolder, prepared: Prepared, wishes: Wishes) -> None:
    try:
        from fogwatch.pictures.run_end import run_picture

        run_picture(folder.path, folder.picture, prepared)
    except ImportError as error:
        wishes.show.say(f"no picture: {error.name} is not installed (pip install 'fogwatch[sim]')")
    except (BadInput, OSError) as error:
        wishes.show.say(f"no picture: {error}")


class _Calling:
    """Passes metrics on to a function and shows nothing else."""

    def __init__(self, metrics: Callable[[Metrics], None]) -> None:
        self.metrics = metrics

    def say(self, line: str) -> None:
        """Nothing."""

    def notice(self, notice: Notice) -> None:
        """Nothing."""

    def close(self) -> None:
        """Nothing."""
