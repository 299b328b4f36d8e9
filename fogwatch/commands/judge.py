"""``fogwatch judge``: a finished run judged again, on any machine. Raises BadInput; the caller prints it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from fogwatch.cli.command_help import command
from fogwatch.cli.ending import note, say
from fogwatch.cli.open_run import Key, RunFolder
from fogwatch.cli.options import option
from fogwatch.run_folder.derived import same_scenario
from patrol.errors import quoted

if TYPE_CHECKING:
    from patrol.prepare import Prepared
    from patrol.summary.model import Summary

DISAGREES = 1
MOST_SHOWN = 20
"""Differences printed at most."""
NO_KEY = "(no --key)"
"""In place of a key's file that a scenario names."""


@command(
    examples=["fogwatch judge runs/yards-20260101-120000"],
    exit_codes="0 verdict valid, 1 verdict invalid, or summary.json or scenario.yaml disagrees with the journal, 2 bad "
    "input, 3 verdict unknown (the journal does not reach its end)",
)
def judge(
    run: RunFolder, key: Key = None, as_json: Annotated[bool, option("", "Print JSON.", "--json")] = False
) -> int:
    """Judge a run again, by its scenario and its journal, and say where its summary.json says something else.

    It opens no file outside of the run's folder but the key, and runs nothing that is in the folder. The exit codes of
    the processes are in no journal: those that summary.json states are taken as they are.
    """
    from monitor.replay.run import prepared_in
    from monitor.replay.run_files import SUMMARY, journal_in, read_summary
    from patrol.journal import trace_hash
    from runtime.starting.warmup import warm
    from worldsim.verdict.agreement import differences, missing, not_repeated

    journal = journal_in(run)
    stated_summary = read_summary(run / SUMMARY)
    warm(("patrol", "worldsim"), note)
    from worldsim.output.summary import summarise
    from worldsim.verdict.judge import judge as judge_journal

    loaded = _with_key(prepared_in(run, journal), key)
    codes = {} if stated_summary is None else stated_summary.exit_codes
    edited = not same_scenario(loaded.scenario, journal)
    summary, verdict = summarise(journal, judge_journal(journal, codes, loaded), loaded.as_operated(journal.events))
    recomputed = json.loads(json.dumps(summary.document()))
    as_stated = {} if stated_summary is None else stated_summary.document()
    differing = differences(as_stated, recomputed)
    facts = {
        "verdict": recomputed["verdict"],
        "ended": summary.ended,
        "simulated_s": summary.simulated_s,
        "duration_s": loaded.scenario.duration,
        "trace_hash": trace_hash(journal.ticks, loaded.scenario.spares),
        "mfow_mean_s": recomputed["mfow_mean_s"],
        "exit_codes": codes,
        "scenario_agrees": not edited,
        "summary_agrees": None if stated_summary is None else not differing,
        "differences": [asdict(difference) for difference in differing],
        "not_in_summary": [] if stated_summary is None else missing(as_stated, recomputed),
        "not_repeated": not_repeated(as_stated, recomputed),
    }
    if as_json:
        typer.echo(json.dumps(facts, indent=2))
    else:
        _print_judgement(summary, facts)
    return verdict.exit_code or (DISAGREES if differing or edited else 0)


def _with_key(prepared: Prepared, key: Path | None) -> Prepared:
    """Return the scenario with the key that was given: the file that it names may be a stranger's."""
    radio = prepared.scenario.radio
    if radio.key is None:
        return prepared
    keyed = radio.model_copy(update={"key": str(key or NO_KEY)})
    return replace(prepared, scenario=prepared.scenario.model_copy(update={"radio": keyed}))


def _end_text(summary: Summary, duration_s: float) -> str:
    """Say how much of its time a run lasted: the verdict does not count an early end against it."""
    time = f"after {summary.simulated_s:g} s of {duration_s:g} s"
    return f"{time}: completed" if summary.ended == "completed" else f"early, {time}: {summary.ended or 'cut off'}"


def _print_judgement(summary: Summary, facts: Mapping[str, Any]) -> None:
    from rich.console import Console

    from fogwatch.terminal.summary_text import print_verdict

    assert summary.verdict is not None
    print_verdict(Console(), summary.verdict)
    say(f"ended       {_end_text(summary, facts['duration_s'])}")
    say(f"trace       {facts['trace_hash']}")
    if codes := facts["exit_codes"]:
        say(f"exit codes  of {len(codes)} processes, as summary.json states them: no journal holds any")
    elif summary.ended is not None and "refused" not in summary.model_fields_set:  # which every world process states
        say("exit codes  none: the run was in one process")
    else:
        say("exit codes  none are known: how processes ended was not judged")
    if not facts["scenario_agrees"]:
        say("scenario    scenario.yaml is not the scenario that the journal was written for")
    if facts["summary_agrees"] is None:
        say("summary     there is no summary.json, or it is not complete")
        return
    if facts["not_repeated"]:
        say(f"checks      not repeated: {', '.join(facts['not_repeated'])}")
    if unstated := facts["not_in_summary"]:
        say(f"summary     does not state {', '.join(unstated)}")
    if not (differing := facts["differences"]):
        say(f"summary     agrees with the journal in every {'other ' * bool(unstated)}field")
        return
    say(f"summary     disagrees with the journal in {len(differing)} field{'s' * (len(differing) > 1)}")
    for differs in differing[:MOST_SHOWN]:
        say(f"  {differs['field']}: {quoted(differs['stated'])}, and by the journal {quoted(differs['found'])}")
    if len(differing) > MOST_SHOWN:
        say(f"  and {len(differing) - MOST_SHOWN} more (--json lists them)")
