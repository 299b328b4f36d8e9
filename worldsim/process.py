"""The process around the world: it gathers the robots, runs the ticks, and records events as they happen."""

from __future__ import annotations

import json
import shutil
import time
from argparse import Namespace
from collections.abc import Sequence
from contextlib import ExitStack, closing
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from patrol.errors import BadInput
from patrol.files.whole_file import write_whole
from runtime.process.context import ProcessContext, run_with
from runtime.process.deadline import ANSWER_S
from runtime.process.failures import INTERRUPTED, UNKNOWN
from runtime.process.options import TOGETHER, Meeting, ProcessParser, fleet_parser
from runtime.reporting.logs import Log
from runtime.security.roles import Kind
from worldsim.run_record import Unwritten

if TYPE_CHECKING:
    from patrol.prepare import Prepared
    from patrol.scenario import Scenario
    from worldsim.fleet.sessions import Sessions
    from worldsim.radio.listener import Listener
    from worldsim.wiring import Wiring

HELP = f"""
The world of a fleet whose other processes run elsewhere. {TOGETHER}

The run begins when all robots of the scenario are there. The folder gets the journal and ticks.csv; without a launcher
also summary.json and scenario.yaml with a copy of its map, for `fogwatch report`, `replay` and `record`.
Exit codes: 0 verdict valid, 1 invalid, 2 bad input, 3 unknown (it could not be judged), 130 interrupted.
"""

JUDGING_S = 3600.0
"""Time for which a service manager is asked to wait for the verdict, s."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one world."""
    options = world_parser().parse_args(arguments)
    return run_with(options, "world", _run_process, on_death=lambda: _remove_static(options))


def _remove_static(options: Namespace) -> None:
    """Remove the static fields of a run that a launcher began, which may be gone."""
    if options.lifeline is not None and options.static is not None:
        for static in (options.static, options.static.with_suffix(".part")):
            shutil.rmtree(static, ignore_errors=True)


def _run_process(process: ProcessContext) -> int:
    """Run the world, and leave nothing behind that a launcher would have removed; return the exit code."""
    meeting = process.meet(Kind.WORLD)
    process.follow(fleet=meeting.keys.fleet)
    try:
        return _run_and_judge(process, meeting)
    except Unwritten as unwritten:
        process.log.error(str(unwritten))
        return UNKNOWN
    finally:
        if process.ending:
            _remove_static(process.options)


def _run_and_judge(process: ProcessContext, meeting: Meeting) -> int:
    """Check the input, connect, record the run and, without a launcher, judge it; return the exit code."""
    from patrol.classes.static_check import announce
    from patrol.own_sensor import allow_sensor, sensor_named
    from patrol.scenario import load_scenario, naming
    from runtime.security.access import read_access
    from runtime.security.keys import callers_of, check_radio
    from worldsim.output.folder import check
    from worldsim.radio.models import model_named

    options = process.options
    token = None if meeting.credentials is None else meeting.credentials.token
    token = token if options.control is None else read_access(options.control, "--control").token
    scenario = load_scenario(options.scenario)
    _check_process_control(scenario, options)
    radio = check_radio(options.radio, "--radio", scenario.radio.via)
    check(options.scenario, options.out)
    process.warm(("patrol", "worldsim"), scenario)
    if not process.launched:
        announce([sensor_named(scenario.sensor), model_named(scenario)])
    allow_sensor(scenario.sensor, record=True)

    from worldsim.fleet.sessions import Interrupted, Missing
    from worldsim.wiring import Wiring

    with naming(options.scenario):
        prepared = process.prepare(scenario)
    callers = callers_of(meeting.keys, {spec.name: spec.number for spec in scenario.roster})
    with ExitStack() as opened:
        link, air = process.open_links(meeting, radio, callers, closing=opened)
        outward, _ = process.open_links(meeting.beside, quiet=True, closing=opened)  # the first has said that it waits
        wiring = Wiring(process, scenario, meeting.keys, link, outward, air)
        try:
            listener = wiring.listener()
            _record_run(wiring, prepared, wiring.gather(), listener, token)
        except Interrupted:
            return INTERRUPTED
        except Missing as missing:
            process.log.error(f"{missing}; {_missing_remedy(meeting)}")
            return UNKNOWN
    if process.launched:
        return 0  # the journal is complete; the launcher judges it
    process.notifier.busy(JUDGING_S)
    code = _judge_run(options.out, prepared, process.log)
    return INTERRUPTED if process.ending else code


def _missing_remedy(meeting: Meeting) -> str:
    """Return the remedy for robots that have not come."""
    if meeting.credentials is None:
        return (
            f"start each with: fogwatch agent --router {meeting.router} --fleet {meeting.keys.fleet} --robot NAME ..."
        )
    return "start each with: fogwatch agent --credentials FOLDER ...; or one of them was revoked, or this world"


def _check_process_control(scenario: Scenario, options: Namespace) -> None:
    """Refuse faults that kill, pause or start processes without the launcher that has started these."""
    from worldsim.faults import Timeline
    from worldsim.fleet.acts import NEEDS_LAUNCHER

    if options.process_control is None and Timeline(scenario).needs_process_control:
        raise BadInput(NEEDS_LAUNCHER)


def _record_run(
    wiring: Wiring, prepared: Prepared, sessions: Sessions, listener: Listener | None, token: str | None
) -> None:
    """Run the ticks and record them."""
    from patrol.journal import JournalWriter
    from worldsim.fleet.loop import run_ticks
    from worldsim.fleet.sessions import Interrupted
    from worldsim.output.folder import keep
    from worldsim.output.record import Recorder, header_of
    from worldsim.output.ticks_table import TicksTable
    from worldsim.run_record import INTERRUPTED as RUN_INTERRUPTED
    from worldsim.run_record import PutOff, recording
    from worldsim.wiring import put_off
    from worldsim.world import World

    scenario, options = prepared.scenario, wiring.options
    world = World(prepared, operated=token is not None)
    fleet = wiring.fleet(sessions, listener)
    control = wiring.process_control(sessions)
    operator = wiring.operator(world, fleet, token)
    header = header_of(world, datetime.now(UTC).isoformat(timespec="seconds"))
    with (
        JournalWriter(options.out / "journal", header) as journal,
        closing(TicksTable(options.out / "ticks.csv", scenario.step)) as table,
    ):
        if not wiring.process.launched:
            keep(scenario, options.scenario, options.out)
        feed = wiring.feed(world, journal, header, fleet, operator)
        recorder = Recorder(feed, scenario.spares)
        later = PutOff(*wiring.sinks(world, recorder, table, feed.between))
        put_off(later, world, fleet, operator, feed.rest)
        reason = RUN_INTERRUPTED
        began = time.monotonic()
        try:
            reason = run_ticks(world, fleet, later.tick, later.event, wiring.leaving, control, operator, later.settle)
        except Interrupted:
            pass
        except Unwritten:
            reason = ""  # room for an end record may be left, and the run would be judged by a part of it
            raise
        except BaseException as error:
            reason = f"failed: {type(error).__name__}: {error}"
            raise
        finally:
            wall_s, refused = time.monotonic() - began, dict(sessions.refused)
            if reason:
                with recording(options.out):
                    recorder.end(reason, {"wall_s": wall_s, "refused": refused, **fleet.notes()})
            feed.flush()


def _judge_run(out: Path, prepared: Prepared, log: Log) -> int:
    """Summarise and judge a run whose robots were not started by a launcher; return the exit code."""
    from patrol.journal import read_journal
    from worldsim.output.summary import summarise
    from worldsim.verdict.judge import judge

    journal = read_journal(out / "journal")
    summary, verdict = summarise(journal, judge(journal, {}, prepared), prepared)
    write_whole(out / "summary.json", f"{json.dumps(summary.document(), indent=2)}\n")
    mean = summary.mfow_mean_s
    mfow = "no ticks" if mean is None else f"mean MFoW {mean:.1f} s"
    warned = ", with warnings" if verdict.warnings else ""
    tell = log.info if verdict.exit_code == 0 else log.error
    tell(f"verdict {verdict.outcome}{warned}, {mfow}; see {out / 'summary.json'}")
    for line in verdict.warnings:
        log.warning(f"  warning: {line}")
    for check in verdict.failed:
        log.error(f"  {check.name}: {check.detail}")
    return verdict.exit_code


def world_parser() -> ProcessParser:
    """Return the parser of the world's command line."""
    parser = fleet_parser(
        "python -m worldsim", "The world of a simulated fleet, as a process.", HELP, "router and robots"
    )
    add = parser.add_argument
    add("--out", required=True, type=Path, metavar="DIR", help="folder for the journal and ticks.csv")
    add(
        "--deadline",
        type=float,
        default=ANSWER_S,
        metavar="S",
        help="lockstep: wall time for an answer (%(default)g s)",
    )
    add(
        "--control",
        type=Path,
        metavar="FILE",
        help="obey operators who have the token in this file (default: the credentials')",
    )
    add(
        "--process-control",
        type=int,
        metavar="FD",
        help="socket on which to ask for kills, pauses and starts (set by the launcher)",
    )
    return parser
