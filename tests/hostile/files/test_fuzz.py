"""Whatever bytes a file holds, reading it gives a value or one line."""

from __future__ import annotations

import json
from contextlib import suppress
from functools import partial
from pathlib import Path

import msgpack
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from experiments.sweeps.plan import read_plan
from experiments.sweeps.results import FILE, open_results
from monitor.recording.mcap_file import inspect_recording
from monitor.replay.run import open_run
from monitor.report.analysis import analyse
from monitor.report.document import report_html
from patrol.journal import unpack
from patrol.maps.load import read_terrain
from patrol.scenario import load_scenario
from patrol.security.access import read_access
from patrol.security.private_files import fleet_key
from tests.hostile.files.looks import as_json, looked_at, value_or_line
from tests.hostile.files.strange_files import (
    VALUES,
    changed,
    places_in,
    records_of,
    strange_bytes,
    strange_journal,
    strange_value,
)

SWEEP = "base: {terrain: {builtin: open}, point: 2, duration: 10}\ngrid: {robots.count: [1, 2]}\nseeds: [1, 2]\n"

fuzz = partial(settings, deadline=None, suppress_health_check=list(HealthCheck))
LONG = (pytest.mark.accept, pytest.mark.timeout(7200))
often = pytest.mark.parametrize("examples", [100, pytest.param(2000, marks=LONG)])


@often
def test_no_journal_gives_anything_but_a_value_or_a_line(examples: int, strange: Path) -> None:
    honest = (strange / "journal").read_bytes()

    @fuzz(max_examples=examples)
    @given(strange_journal(honest))
    def check(journal: bytes) -> None:
        (strange / "journal").write_bytes(journal)
        value_or_line(lambda: looked_at(strange))

    check()


@often
def test_no_summary_gives_anything_but_a_value_or_a_line(examples: int, strange: Path) -> None:
    honest = (strange / "summary.json").read_bytes()
    says = json.loads(honest)

    @fuzz(max_examples=examples)
    @given(strange_bytes(honest) | strange_value(says).map(as_json))
    def check(summary: bytes) -> None:
        (strange / "summary.json").write_bytes(summary)
        value_or_line(lambda: report_html(analyse(open_run(strange)), []))

    check()


@often
def test_no_scenario_gives_anything_but_a_value_or_a_line(examples: int, strange: Path) -> None:
    path = strange / "scenario.yaml"
    honest = path.read_bytes()
    says = json.loads(json.dumps(load_scenario(path).model_dump(mode="json")))

    @fuzz(max_examples=examples)
    @given(strange_bytes(honest) | strange_value(says).map(as_json))
    def check(scenario: bytes) -> None:
        path.write_bytes(scenario)
        value_or_line(lambda: load_scenario(path))

    check()


@often
def test_no_map_gives_anything_but_a_value_or_a_line(examples: int, strange: Path) -> None:
    path = strange / "map" / "hall.yaml"
    text, image = path.read_bytes(), path.with_name("hall.pgm").read_bytes()

    @fuzz(max_examples=examples)
    @given(strange_bytes(text), strange_bytes(image), st.integers(0, 2))
    def check(text_: bytes, image_: bytes, which: int) -> None:
        path.write_bytes(text if which == 0 else text_)
        path.with_name("hall.pgm").write_bytes(image if which == 1 else image_)
        value_or_line(lambda: read_terrain(path, 1.0))

    check()


@often
def test_no_recording_gives_anything_but_a_value_or_a_line(examples: int, strange: Path) -> None:
    path = strange / "recording.mcap"
    honest = path.read_bytes()

    @fuzz(max_examples=examples)
    @given(strange_bytes(honest))
    def check(recording: bytes) -> None:
        path.write_bytes(recording)
        value_or_line(lambda: inspect_recording(path))
        value_or_line(lambda: inspect_recording(path, strange / "repaired.mcap"))
        (strange / "repaired.mcap").unlink(missing_ok=True)

    check()


@often
def test_no_sweep_gives_anything_but_a_value_or_a_line(examples: int, tmp_path: Path) -> None:
    path = tmp_path / "sweep.yaml"
    line = b'{"key":"k","case":"c","seed":1,"outcome":"ok","error":null,"metrics":{"a":1.5},"trace_hash":null,'
    line += b'"wall_s":1.0,"software":"0","settings":{}}\n'

    @fuzz(max_examples=examples)
    @given(strange_bytes(SWEEP.encode()), strange_bytes(line * 3))
    def check(plan: bytes, results: bytes) -> None:
        path.write_bytes(plan)
        value_or_line(lambda: read_plan(path))
        (tmp_path / FILE).write_bytes(results)

        def read() -> None:
            with open_results(tmp_path):
                pass

        value_or_line(read)

    check()


@often
def test_no_key_or_access_gives_anything_but_a_value_or_a_line(examples: int, tmp_path: Path) -> None:
    path = tmp_path / "file"
    access = {"fleet": "yards-1", "router": "tcp/127.0.0.1:7447", "token": "t" * 32}

    @fuzz(max_examples=examples)
    @given(st.binary(max_size=200) | strange_value(access).map(as_json))
    def check(content: bytes) -> None:
        path.write_bytes(content)
        value_or_line(lambda: fleet_key(path))
        value_or_line(lambda: read_access(path, "--access"))

    check()


@often
def test_no_record_gives_anything_but_a_value_or_a_value_error(examples: int, run_folder: Path) -> None:
    payloads = records_of((run_folder / "journal").read_bytes())

    @fuzz(max_examples=10 * examples)
    @given(st.sampled_from(payloads).flatmap(strange_bytes) | st.binary(max_size=64))
    def check(payload: bytes) -> None:
        with suppress(ValueError):
            unpack(payload)

    check()


def test_every_place_of_a_tick_is_checked(strange: Path) -> None:
    """Each strange value in each place of a tick, an event, the header and the end."""
    payloads = records_of((strange / "journal").read_bytes())
    ticks = [one for one in payloads if one[1:11] == b"\xa4type\xa4tick"]
    chosen = [ticks[len(ticks) // 2], *[one for one in payloads if one not in ticks][1:3], payloads[-1]]
    for payload in chosen:
        record = msgpack.unpackb(payload, strict_map_key=False)
        for place in places_in(record):
            for value in VALUES:
                with suppress(ValueError):
                    unpack(msgpack.packb(changed(record, place, value)))
