"""Run a scenario from Python: `fogwatch.run(scenario)`, in this process or as a fleet of processes."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Mapping
from contextlib import closing, nullcontext
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fogwatch.notebook.arguments import checked_arguments, policy_name, scenario_of
from fogwatch.notebook.run import Run
from fogwatch.own_classes import find_classes
from fogwatch.run_folder.runfolder import PolicyNotMade, RunFolder, fill, found_again, make_folder
from fogwatch.run_options import RunChoices, chosen_settings
from fogwatch.terminal.live_table import CallbackDisplay, RunDisplay
from patrol.errors import BadInput
from patrol.measures.zoned import with_rounds
from patrol.scenario import Scenario, load_scenario, naming, with_assumed
from patrol.scenario.assumptions import assumption_lines
from patrol.scenario.patrols import describe_patrol
from patrol.scenario.policies import BUILT_IN, STOCHASTIC
from runtime.messages.telemetry import Metrics
from runtime.process.lifeline import InterruptedBySignal
from runtime.security.private_files import fleet_key
from runtime.starting.compiling import compiling_meanwhile
from runtime.starting.warmup import missing_kernels, seldom_kernels, warm

if TYPE_CHECKING:
    from patrol.journal import Event, Journal, TickRecord
    from patrol.prepare import Prepared
    from patrol.summary.model import Summary
    from runtime.starting.compiling import Compiled
    from worldsim.run_record import RunRecord
    from worldsim.verdict.judge import Verdict
    from worldsim.world import World

__all__ = ["RunOptions", "execute", "run"]

LARGE_POINTS = 500_000
"""Points of patrolled ground for which finding a tour takes long enough to say so."""

EAGER = 16
"""Fleets of up to this many robots are started before the check that they fit, which saves time."""
PACKAGES = ("patrol", "agent", "worldsim")
"""Packages whose kernels a run needs to begin."""
LATER = ("experiments", "monitor")
"""Packages whose kernels recordings, reports and pages need; a page compiles the second itself."""


@dataclass(frozen=True)
class RunOptions(RunChoices):
    """Options of making a run, and of its progress.

    Attributes:
        display: Shows the progress.
        begin: Called when the ticks are about to begin. Before that, KeyboardInterrupt ends everything.
        stop: Asked from then on whether to end early.
        urgent: Asked from then on whether to end by force.
        over: Called when the ticks are over. From then on KeyboardInterrupt stops judging and writing files.
        judged: Called with the summary when the run has been judged, before files are made from its journal.
        show_kernels: Shows how far compiling the kernels is; None for a line every few seconds.
    """

    display: RunDisplay = field(default_factory=RunDisplay)
    begin: Callable[[], None] = lambda: None
    stop: Callable[[], bool] = lambda: False
    urgent: Callable[[], bool] = lambda: False
    over: Callable[[], None] = lambda: None
    judged: Callable[[Summary], None] = lambda _summary: None
    show_kernels: Callable[[Compiled], None] | None = None


@checked_arguments
def run(
    scenario: Scenario | Mapping[str, Any] | str | Path,
    *,
    out: str | Path | None = None,
    in_process: bool = True,
    progress: Callable[[Metrics], None] | None = None,
    patrol: str | None = None,
    preset: str | None = None,
    overrides: Mapping[str, object] | None = None,
    policy: type[Any] | None = None,
    picture: bool = True,
    recording: bool = False,
    report: bool = False,
    recovery: bool = False,
) -> Run:
    """Run a scenario to its end.

    Args:
        scenario: A scenario file, a map's YAML file, the name of a built-in terrain, a mapping shaped like a scenario
            file, or a loaded scenario.
        out: The run folder, new or empty; ``runs/<name>-<time>`` unless given.
        in_process: Whether to run in this process, or as one process per robot over Zenoh. Both give the same trace.
        progress: Called with the measures so far, at most ten times a second.
        patrol: ``stochastic`` (the default), ``paper`` or ``tour``, as for ``fogwatch run --patrol``.
        preset: Settings that belong together, as for ``fogwatch run --preset``: ``paper`` is the paper's algorithm,
            bodies and sensor with rules of ours where it is open or fails, ``letter`` the same without our additions.
            Both have points of 0.5 m (the paper's: 0.1 m).
        overrides: Values by dotted field, such as ``{"patrol.options.separation": "none"}``; they hold over the preset.
        policy: A policy class (docs/policies.md), instead of a name in ``patrol.policy``; one that was defined in a
            notebook or a script runs in this process only, and its code is no part of the scenario's hash.
        picture: Whether to draw fog.png, the final fog, which takes about a second.
        recording: Whether to write recording.mcap as well; `fogwatch record` writes it at any later time.
        report: Whether to write report.html as well; `fogwatch report` writes it at any later time.
        recovery: Whether to run a scenario with faults without them too, so that the verdict can judge the recovery.

    Returns:
        The run, whose verdict, tables and figures can be asked for.

    Raises:
        BadInput: The input is wrong; the message is one line that says what, and how to mend it.
        fogwatch.launch.launcher.LaunchFailed: The processes could not be brought to run.
        KeyboardInterrupt: The run was interrupted before its first tick; its folder is gone again.
    """
    overrides = chosen_settings(overrides or {}, patrol, preset)
    if policy is not None:
        overrides["patrol.policy"] = policy_name(policy, in_process=in_process)
    loaded = scenario_of(scenario, overrides)
    files: dict[str, Any] = {"page": False, "picture": picture, "recording": recording, "report": report}
    display = RunDisplay() if progress is None else CallbackDisplay(progress)
    folder = None if out is None else Path(out)
    options = RunOptions(out=folder, in_process=in_process, recovery=recovery, display=display, **files)
    with naming(scenario, overrides) if isinstance(scenario, str | Path) else nullcontext():
        return execute(loaded, options)


def execute(scenario: Scenario, options: RunOptions) -> Run:
    """Run a loaded scenario.

    Args:
        scenario: The scenario.
        options: How to run it.

    Returns:
        The run.

    Raises:
        BadInput: The scenario cannot be run, or the run folder cannot be used.
        fogwatch.launch.launcher.LaunchFailed: The processes could not be brought to run.
        KeyboardInterrupt: The run was interrupted before its first tick.
    """
    watched = options.recording or options.report or options.page
    warm(PACKAGES, options.display.say, seldom_kernels(scenario), options.show_kernels)
    find_classes([scenario], record=True)
    folder = make_folder(scenario, options.out, datetime.now().astimezone())
    try:
        fill(folder, scenario, options.out)
        resolved = with_assumed(folder.load(), scenario.assumed)
        fleet_key(resolved.radio.key)  # an error in it is reported before any process starts
        with compiling_meanwhile(missing_kernels(LATER) if watched else {}):
            return (_in_this_process if options.in_process else _as_processes)(resolved, folder, options)
    except (BadInput, KeyboardInterrupt) as error:
        has_begun = folder.journal.exists()  # the ticks of a run that has begun are kept
        if folder.path.exists() and not has_begun and not isinstance(error, PolicyNotMade):
            folder.discard()
            if isinstance(error, BadInput):
                raise type(error)(folder.naming_the_given_map(str(error), scenario)) from None
        raise
    finally:
        options.display.close()


def _begin_run(options: RunOptions) -> None:
    """Call `begin`, unless the run has been stopped before: then raise KeyboardInterrupt."""
    options.begin()
    if options.stop():
        raise KeyboardInterrupt


def _in_this_process(scenario: Scenario, folder: RunFolder, options: RunOptions) -> Run:
    from fogwatch.inprocess import run_in_process
    from fogwatch.workers import WorkerEnded
    from patrol.prepare import prepare
    from worldsim.output.live_progress import LiveProgress
    from worldsim.output.ticks_table import TicksTable
    from worldsim.run_record import Unwritten, recording

    prepared = prepare(scenario)
    _announce_run(prepared, folder, options)
    prepared = _find_rounds(prepared, options.display)
    progresses: list[LiveProgress] = []
    _begin_run(options)
    baseline_s = _baseline_mfow(prepared, options)
    with closing(TicksTable(folder.ticks, scenario.step)) as table:

        def watch(world: World) -> Callable[[TickRecord], None]:
            progress = LiveProgress(world, time.monotonic)
            progresses.append(progress)

            def on_tick(record: TickRecord) -> None:
                table.tick(record)
                metrics, notices = progress.tick(record)
                for notice in notices:
                    options.display.notice(notice)
                if metrics is not None:
                    options.display.metrics(metrics)

            return on_tick

        def on_event(event: Event) -> None:
            options.display.notice(progresses[0].event(event))

        def on_failure(number: int, reason: str, error: BaseException | None) -> None:
            log = folder.keep_failure(name := scenario.roster[number - 1].name, reason, error)
            if not progresses:  # the mind of a run that has not begun
                raise PolicyNotMade(reason, log)
            options.display.say(f"{name}: {reason}; more in {log}")

        try:
            with recording(folder.path):
                outcome = run_in_process(
                    prepared,
                    journal=folder.journal,
                    started=datetime.now(UTC).isoformat(timespec="seconds"),
                    watch=watch,
                    events=on_event,
                    stop=options.stop,
                    workers=min(len(scenario.roster), options.workers),
                    baseline_s=baseline_s,
                    failure=on_failure,
                )
        except (Unwritten, WorkerEnded) as ended:
            from fogwatch.launch.launcher import LaunchFailed

            raise LaunchFailed(str(ended)) from None
    options.over()
    return _write_result(folder, prepared, outcome.journal, outcome.verdict, outcome.summary, options)


def _as_processes(scenario: Scenario, folder: RunFolder, options: RunOptions) -> Run:
    from fogwatch.launch.launcher import WORLD, Launch, LaunchFailed, check_limits
    from patrol.prepare import prepare
    from worldsim.faults import Timeline

    names = [spec.name for spec in scenario.roster]
    check_limits(len(names), len(scenario.spares))
    prepared = prepare(scenario) if len(names) > EAGER else None
    fleet, alike = f"{scenario.name}-{os.urandom(4).hex()}", scenario.patrol.policy in BUILT_IN
    absent = [names[number - 1] for number in Timeline(scenario).starts_absent]
    handle = os.open(folder.path, os.O_RDONLY | os.O_DIRECTORY)
    launch = Launch(folder, fleet, names, options.display, options.stop, options.port, options.urgent)
    launch.absent, launch.page, launch.key = absent, options.page, scenario.radio.key
    launch.alike, launch.kernels = alike, seldom_kernels(scenario)
    try:
        launch.start()
        prepared = prepared or prepare(scenario)
        _announce_run(prepared, folder, options)
        prepared = _find_rounds(prepared, options.display)
        _write_static(prepared, folder)
        _begin_run(options)
        folder.unfinished_static.rename(folder.static)
        launch.watch()
    except BaseException:
        launch.interrupted = True
        raise
    finally:
        try:
            exit_codes = launch.finish()
        except KeyboardInterrupt:  # an interruption meanwhile ends them by force
            exit_codes = launch.finish()
        folder = found_again(folder, handle, options.display.say)
        for static in (folder.static, folder.unfinished_static):
            shutil.rmtree(static, ignore_errors=True)
    options.over()
    if not folder.journal.exists():
        raise KeyboardInterrupt if launch.interrupted else LaunchFailed(launch.children.by_name[WORLD].describe_end())
    if exit_codes[WORLD] != 0:
        options.display.say(launch.children.by_name[WORLD].describe_end())
    return _judge_ended(folder, prepared, exit_codes, options)


def _judge_ended(folder: RunFolder, prepared: Prepared, codes: Mapping[str, int | None], options: RunOptions) -> Run:
    """Judge a run whose processes have ended, and write its files."""
    from fogwatch.launch.launcher import LaunchFailed
    from fogwatch.run_folder.derived import JUDGING, show_progress
    from patrol.journal import read_journal
    from worldsim.output.summary import summarise
    from worldsim.verdict.judge import Judge

    try:
        journal = read_journal(folder.journal)
    except BadInput as bad:
        raise LaunchFailed(str(bad)) from None
    operated = prepared.as_operated(journal.events)
    try:
        options.display.progress(JUDGING)
        judging = Judge(journal, codes, operated, baseline_s=_baseline_mfow(operated, options))
        for count, record in enumerate(journal.ticks, 1):
            judging.tick(record)
            show_progress(options.display, JUDGING, count, operated.scenario.ticks)
        summary, verdict = summarise(journal, judging.verdict(), operated)
        options.display.progress(JUDGING, 1.0)
    except InterruptedBySignal:
        options.display.say(f"interrupted before the run was judged; `fogwatch judge {folder.path}` judges it")
        raise
    summary = summary.model_copy(update={"exit_codes": dict(codes)})
    return _write_result(folder, operated, journal, verdict, summary, options)


def _announce_run(prepared: Prepared, folder: RunFolder, options: RunOptions) -> None:
    """Show what is about to run, once its input is known to be right, and what to know of its ground."""
    from fogwatch.grounds.scenario_notes import scenario_notes

    scenario = prepared.scenario
    count = scenario.team
    robots = "1 robot" if count == 1 else f"{count} robots"
    if scenario.spares:
        robots += f" ({len(scenario.spares)} more may join)"
    options.display.say(f"{scenario.name}: {robots} for {scenario.duration:g} s; run folder {folder.path}")
    draws = ""
    if scenario.patrol.policy == STOCHASTIC:
        draws = f" (draws come from the {'seed; with radio.key from the key' if scenario.radio.key is None else 'key'})"
    patrol = f"patrol: {describe_patrol(scenario.patrol.policy)}{draws}"
    warnings = [f"warning: {line}" for line in scenario_notes(prepared)]
    options.display.announced = [*assumption_lines(scenario), patrol, *warnings]
    for line in options.display.announced:
        options.display.say(line)


def _baseline_mfow(prepared: Prepared, options: RunOptions) -> float | None:
    """Return the mean MFoW (s) without faults; None where it is not wanted, or one process cannot find it out."""
    scenario = prepared.scenario
    is_judged = options.recovery and bool(scenario.faults) and scenario.radio.via == "ether"
    if not is_judged or options.stop():
        return None
    from fogwatch.inprocess import fault_free_mfow

    options.display.say("running the scenario without its faults, to judge the recovery ...")
    return fault_free_mfow(prepared, options.stop)


def _find_rounds(prepared: Prepared, display: RunDisplay) -> Prepared:
    """Find what robots follow, and show it where that may take a minute (`with_rounds`)."""
    needed, points = prepared.scenario.patrol.needs_rounds, np.count_nonzero(prepared.patrolled)
    shown = needed and points > LARGE_POINTS
    step = f"finding a short tour of {points * prepared.terrain.point_area:.0f} m², which is kept for later runs"
    if shown:
        display.progress(step)
    prepared = with_rounds(prepared, needed)
    if shown:
        display.progress(step, 1.0)
    return prepared


def _write_static(prepared: Prepared, folder: RunFolder) -> None:
    """Write the static fields for the processes, which wait until their folder is renamed."""
    from agent.psi import save_psi

    part = folder.unfinished_static
    try:
        prepared.save(part)
        save_psi(prepared, part)
    except OSError as error:  # without a number where numpy could write a part only
        why = error.strerror or str(error)
        raise BadInput(f"{folder.path}: the ground cannot be written for the processes ({why}); make room") from None


def _scenario_changed(folder: RunFolder, journal: Journal) -> bool:
    """Return whether the folder's scenario is another one than the run's."""
    from fogwatch.run_folder.derived import same_scenario

    try:
        return not same_scenario(load_scenario(folder.scenario, opens_classes=False), journal)
    except BadInput:
        return folder.path.exists()


def _write_result(
    folder: RunFolder, prepared: Prepared, journal: RunRecord, verdict: Verdict, summary: Summary, options: RunOptions
) -> Run:
    """Write the summary and the files that are made from the journal."""
    from fogwatch.run_folder.derived import write_files
    from patrol.journal import Journal
    from patrol.summary.model import Summary
    from worldsim.checks.check import CheckResult
    from worldsim.output.summary import verdict_facts
    from worldsim.run_record import INTERRUPTED

    assert isinstance(journal, Journal)  # every run of this module writes one
    if _scenario_changed(folder, journal):
        why = "scenario.yaml is not the scenario that ran: it was changed or removed during the run"
        verdict = replace(verdict, outcome="invalid", checks=(*verdict.checks, CheckResult("scenario", False, why)))
        summary = Summary.model_validate({**summary.document(), "verdict": verdict_facts(verdict)})
    try:
        folder.write_summary(summary)
    except OSError as error:
        options.display.say(f"{folder.summary}: cannot be written ({error.strerror}); the summary is shown only")
    interrupted = journal.end is not None and journal.end.reason == INTERRUPTED
    options.display.pause()
    options.judged(summary)
    if summary.ticks:
        interrupted |= not write_files(folder, prepared, journal, summary, options, options.display)
    announced = tuple(options.display.announced)
    return Run(folder.path, summary=summary, verdict=verdict, interrupted=interrupted, announced=announced)
