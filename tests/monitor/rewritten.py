"""A run's folder with another story in its journal, judged anew."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from patrol.journal import End, JournalWriter, TickRecord, read_journal
from patrol.prepare import prepare
from patrol.scenario import dump_scenario, load_scenario
from tests.monitor.conftest import Seen
from worldsim.output.record import header_of
from worldsim.output.summary import summarise
from worldsim.verdict.judge import judge
from worldsim.world import World


def rewritten(
    seen: Seen,
    folder: Path,
    tick: Callable[[TickRecord], TickRecord | None] = lambda record: record,
    scenario: Mapping[str, Any] | None = None,
    notes: Mapping[str, Any] | None = None,
) -> Path:
    """tick: what becomes of each tick, None for nothing. scenario: another one. notes: of the journal's end."""
    journal = read_journal(seen.folder / "journal")
    loaded = load_scenario(journal.header.scenario if scenario is None else scenario)
    prepared = prepare(loaded)
    folder.mkdir()
    (folder / "scenario.yaml").write_text(dump_scenario(loaded), encoding="utf-8")
    end = journal.end or End("completed", "")
    with JournalWriter(folder / "journal", header_of(World(prepared))) as writer:
        for record in (*journal.events, *map(tick, journal.ticks), replace(end, notes=notes or end.notes)):
            if record is not None:
                writer.write(record)
    journal = read_journal(folder / "journal")
    summary = summarise(journal, judge(journal, {}, prepared)).document()
    (folder / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    return folder
