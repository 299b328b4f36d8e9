"""Faults planted into the records of runs as processes, for checks that only such runs call for."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fogwatch.api import RunOptions, execute
from monitor.replay.run import prepared_in
from monitor.replay.run_files import journal_in
from patrol.journal import Event
from patrol.prepare import Prepared
from patrol.scenario import load_scenario
from worldsim.checks.journal import SILENT
from worldsim.faults import LOOKED_AT, process_name
from worldsim.run_record import MemoryJournal
from worldsim.verdict.judge import judge

pytestmark = pytest.mark.processes

FLEET: dict[str, Any] = {"terrain": {"builtin": "open"}, "point": 2.0, "duration": 10, "robots": {"count": 2}}
PAUSE = {"kind": "pause", "who": "r1", "at": 2, "for": 2}

Codes = Mapping[str, int | None]


def recorded(folder: Path, **more: Any) -> tuple[MemoryJournal, Codes, Prepared]:
    options = RunOptions(folder / "run", picture=False, recording=False, report=False, page=False)
    run = execute(load_scenario({**FLEET, **more}), options)
    assert run.verdict.valid, run.verdict.failed
    journal = journal_in(folder / "run")
    record = MemoryJournal(journal.header)
    record.records, record.events, record.end = list(journal.ticks), journal.events, journal.end
    return record, run.summary["exit_codes"], prepared_in(folder / "run", journal)


def failed(record: MemoryJournal, codes: Codes, prepared: Prepared) -> list[str]:
    return [check.name for check in judge(record, codes, prepared).failed]


def test_what_processes_did_is_judged(tmp_path: Path) -> None:
    record, codes, prepared = recorded(tmp_path, faults=[PAUSE])
    assert failed(record, codes, prepared) == []
    assert failed(record, {**codes, process_name("r2", 1): -11}, prepared) == ["exit codes"]

    looks = [event for event in record.events if event.kind == LOOKED_AT]
    if looks and looks[0].detail != "its process cannot be looked at here":
        runs_on = [Event(e.k, e.kind, e.robot, "its process runs on") if e in looks else e for e in record.events]
        record.events = tuple(runs_on)
        assert failed(record, codes, prepared) == ["the paused stand still"]


def test_what_robots_report_of_a_direct_radio_is_judged(tmp_path: Path) -> None:
    record, codes, prepared = recorded(tmp_path, radio={"via": "direct"}, pace=4.0, watchdog=10)
    assert record.end is not None
    direct = record.end.notes["direct"]
    said = {name: {**report, "heard": dict.fromkeys(report["heard"], 10**6)} for name, report in direct["said"].items()}
    notes = record.end.notes
    record.end = replace(record.end, notes={**notes, "direct": {**direct, "said": said}})
    assert failed(record, codes, prepared) == ["links add up"]

    record.end = replace(record.end, notes={**notes, SILENT: 20.0})
    warned = [check.name for check in judge(record, codes, prepared).checks if "20 s" in "".join(check.warnings)]
    assert warned == ["router"]
