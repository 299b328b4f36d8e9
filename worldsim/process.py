"""The process around the world: it gathers the robots, runs the ticks, and records what happens as it happens."""

from __future__ import annotations

import json
import os
import shutil
import time
from collections.abc import Sequence
from contextlib import ExitStack, closing
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from patrol.errors import BadInput
from patrol.process.exit_codes import BAD_INPUT, UNKNOWN
from patrol.process.exit_codes import INTERRUPTED as EXIT_INTERRUPTED
from patrol.process.lifeline import Ending, heed
from patrol.process.options import meeting, prepared_as_told
from patrol.process.reporting.logs import Log
from patrol.process.reporting.notify import Notifier
from patrol.process.reporting.supervision import followed
from patrol.whole_file import write_whole
from worldsim.options import WorldOptions, parse_options
from worldsim.run_record import Unwritten

if TYPE_CHECKING:
    from patrol.prepare import Prepared
    from patrol.process.options import Meeting
    from patrol.process.reporting.vitals import Vitals
    from patrol.scenario import Scenario
    from worldsim.fleet.sessions import Sessions
    from worldsim.radio.listener import Listener
    from worldsim.wiring import Wiring

JUDGING_S = 3600.0
"""How long a service manager is asked to wait for the verdict, s."""
_LOG = Log("world")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one world.

    Args:
        arguments: The command line's words, None for those of this process.

    Returns:
        The exit code.
    """
    try:
        options = parse_options(arguments)
    except BadInput as bad:
        _LOG.error(str(bad))
        return BAD_INPUT
    options.supervision.begin_log(_LOG.process)
    ending = heed(options.lifeline, lambda: _remove_static(options))
    try:
        return _follow(options, ending)
    except BadInput as bad:
        _LOG.error(str(bad))
        return BAD_INPUT
    except Unwritten as unwritten:
        _LOG.error(str(unwritten))
        return UNKNOWN
    finally:
        if ending:
            _remove_static(options)


def _remove_static(options: WorldOptions) -> None:
    """Remove the static fields of a run that a launcher began, which may be gone."""
    if options.launched and options.static is not None:
        for static in (options.static, options.static.with_suffix(".part")):
            shutil.rmtree(static, ignore_errors=True)


def _follow(options: WorldOptions, ending: Ending) -> int:
    """Run the world while others may follow how it does; the exit code."""
    from patrol.net.security.roles import Kind

    met = meeting(options, Kind.WORLD)
    with followed(options.supervision, _LOG, {"fleet": met.keys.fleet}) as vitals:
        return _run(options, met, ending, vitals)


def _run(options: WorldOptions, met: Meeting, ending: Ending, vitals: Vitals) -> int:
    """Check the input, connect, record the run and, without a launcher, judge it; the exit code."""
    from patrol.net.keys import check_radio
    from patrol.net.security.access import read_access
    from patrol.own_sensor import allow_sensor
    from patrol.process.starting.seldom import seldom_kernels
    from patrol.process.starting.warmup import warm
    from patrol.scenario import load_scenario
    from worldsim.output.folder import check

    token = None if met.credentials is None else met.credentials.token
    token = token if options.control is None else read_access(options.control, "--control").token
    scenario = load_scenario(options.scenario)
    _check_process_control(scenario, options)
    radio = check_radio(options.radio, "--radio", scenario.radio.via)
    check(options.scenario, options.out)
    warm(("patrol", "worldsim"), _LOG.info, seldom_kernels(scenario))
    allow_sensor(scenario.sensor)

    from worldsim.fleet.sessions import Interrupted, Missing

    prepared = prepared_as_told(scenario, options, ending)
    if prepared is None:
        return EXIT_INTERRUPTED

    notifier = Notifier(os.environ)
    with ExitStack() as opened:
        wiring = _wiring(opened, options, scenario, met, radio, ending, vitals, notifier)
        if wiring is None:
            return EXIT_INTERRUPTED
        try:
            listener = wiring.listener()
            _record(wiring, prepared, wiring.gather(token), listener, token)
        except Interrupted:
            return EXIT_INTERRUPTED
        except Missing as missing:
            _LOG.error(f"{missing}; {_remedy(met)}")
            return UNKNOWN
    if options.launched:
        return 0  # the journal is complete; the launcher judges it
    notifier.busy(JUDGING_S)
    code = _judge(options.out, prepared)
    return EXIT_INTERRUPTED if ending else code


def _wiring(
    opened: ExitStack,
    options: WorldOptions,
    scenario: Scenario,
    met: Meeting,
    radio: str | None,
    ending: Ending,
    vitals: Vitals,
    notifier: Notifier,
) -> Wiring | None:
    """What the world is connected to; the stack closes it. None when it is time to leave."""
    from patrol.net.keys import callers_of
    from patrol.net.open_links import open_links
    from worldsim.wiring import Wiring

    callers = callers_of(met.keys, {spec.name: spec.number for spec in scenario.roster})
    links = open_links(met.router, radio, options.wait, _LOG.info, lambda: bool(ending), met.credentials, callers)
    if links is None:
        return None
    link, air = links
    opened.callback(link.close)
    if air is not link:
        opened.callback(air.close)
    watched = open_links(met.router, None, options.wait, _quietly, lambda: bool(ending), met.credentials)
    if watched is None:
        return None
    outward = watched[0]
    opened.callback(outward.close)
    return Wiring(options, scenario, met.keys, link, outward, air, ending, _LOG, vitals, notifier.alive)


def _remedy(met: Meeting) -> str:
    """What to do about robots that have not come."""
    if met.credentials is None:
        return f"start each with: python -m agent --router {met.router} --fleet {met.keys.fleet} --robot NAME ..."
    return "start each with: python -m agent --credentials FOLDER ...; or one of them was revoked, or this world"


def _check_process_control(scenario: Scenario, options: WorldOptions) -> None:
    """A scenario whose faults kill, pause or start processes needs the launcher that has started these."""
    from worldsim.faults.timeline import Timeline
    from worldsim.fleet.acts import NEEDS_LAUNCHER

    if options.process_control is None and Timeline(scenario).needs_process_control:
        raise BadInput(NEEDS_LAUNCHER)


def _record(
    wiring: Wiring, prepared: Prepared, sessions: Sessions, listener: Listener | None, token: str | None
) -> None:
    """Run the ticks and record what happens."""
    from patrol.journal import JournalWriter
    from worldsim.fleet.loop import run_ticks
    from worldsim.fleet.sessions import Interrupted
    from worldsim.output.folder import keep
    from worldsim.output.record import Recorder, header_of
    from worldsim.output.ticks_table import TicksTable
    from worldsim.run_record import INTERRUPTED, PutOff, recording
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
        if not options.launched:
            keep(scenario, options.scenario, options.out)
        feed = wiring.feed(world, journal, header, fleet, operator)
        recorder = Recorder(feed, scenario.spares)
        later = PutOff(*wiring.sinks(world, recorder, table, feed.between))
        put_off(later, world, fleet, operator, feed.rest)
        reason = INTERRUPTED
        began = time.monotonic()
        try:
            reason = run_ticks(world, fleet, later.tick, later.event, wiring.leaving, control, operator, later.settle)
        except Interrupted:
            pass
        except BaseException as error:
            reason = f"failed: {type(error).__name__}: {error}"
            raise
        finally:
            taken, refused = time.monotonic() - began, dict(sessions.refused)
            said = {"wall_s": taken, "refused": refused, "transcripts": sessions.transcripts()}
            with recording(options.out):
                recorder.end(reason, {**said, **fleet.notes()})
            feed.flush()


def _judge(out: Path, prepared: Prepared) -> int:
    """Summarise and judge a run whose robots were not started by a launcher; the exit code."""
    from patrol.journal import read_journal
    from worldsim.output.summary import summarise
    from worldsim.verdict.judge import judge

    journal = read_journal(out / "journal")
    verdict = judge(journal, {}, prepared)
    summary = summarise(journal, verdict, prepared)
    write_whole(out / "summary.json", f"{json.dumps(summary.document(), indent=2)}\n")
    mean = summary.mfow_mean_s
    mfow = "no ticks" if mean is None else f"mean MFoW {mean:.1f} s"
    warned = ", with warnings" if verdict.warnings else ""
    tell = _LOG.info if verdict.exit_code == 0 else _LOG.error
    tell(f"verdict {verdict.outcome}{warned}, {mfow}; see {out / 'summary.json'}")
    for line in verdict.warnings:
        _LOG.warning(f"  warning: {line}")
    for check in verdict.failed:
        _LOG.error(f"  {check.name}: {check.detail}")
    return verdict.exit_code


def _quietly(_line: str) -> None:
    """Nothing: the first link to the router has said that it waits."""
