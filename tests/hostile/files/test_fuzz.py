"""Whatever bytes a file holds, reading it gives a value or one line."""

import json
import shutil
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import msgpack
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from experiments.sweeps.plan import read_plan
from experiments.sweeps.results import FILE, open_results
from fogwatch.grounds.bags import extract_map
from monitor.replay.run import open_run
from monitor.report.analysis import analyse
from monitor.report.document import report_html
from patrol.journal import unpack
from patrol.maps.load import read_terrain
from patrol.scenario import load_scenario
from runtime.security.access import read_access
from runtime.security.private_files import fleet_key
from tests.hostile.files import strange_files
from tests.hostile.files.looks import as_json, looked_at, value_or_line

SWEEP = "base: {terrain: {builtin: open}, point: 2, duration: 10}\ngrid: {robots.count: [1, 2]}\nseeds: [1, 2]\n"

fuzz = partial(settings, deadline=None, suppress_health_check=list(HealthCheck))
LONG = (pytest.mark.accept, pytest.mark.timeout(7200))
often = pytest.mark.parametrize("examples", [100, pytest.param(2000, marks=LONG)])


@dataclass(frozen=True)
class Case:
    """Files, what they may hold, and what reads them."""

    contents: st.SearchStrategy[tuple[bytes, ...]]
    files: tuple[Path, ...]
    reads: tuple[Callable[[], object], ...]


def case(contents: st.SearchStrategy[bytes], file: Path, *reads: Callable[[], object]) -> Case:
    return Case(st.tuples(contents), (file,), reads)


def strange_json(file: Path, says: Any) -> st.SearchStrategy[bytes]:
    return strange_files.strange_bytes(file.read_bytes()) | strange_files.strange_value(says).map(as_json)


def of_journal(run: Path) -> Case:
    file = run / "journal"
    return case(strange_files.strange_journal(file.read_bytes()), file, lambda: looked_at(run))


def of_summary(run: Path) -> Case:
    file = run / "summary.json"
    contents = strange_json(file, json.loads(file.read_bytes()))
    return case(contents, file, lambda: report_html(analyse(open_run(run)), []))


def of_scenario(run: Path) -> Case:
    file = run / "scenario.yaml"
    says = json.loads(json.dumps(load_scenario(file).model_dump(mode="json")))
    return case(strange_json(file, says), file, lambda: load_scenario(file))


def of_map(run: Path) -> Case:
    files = run / "map" / "hall.yaml", run / "map" / "hall.pgm"
    honest, strange = zip(
        *((st.just(f.read_bytes()), strange_files.strange_bytes(f.read_bytes())) for f in files), strict=True
    )
    contents = st.tuples(honest[0], strange[1]) | st.tuples(strange[0], honest[1]) | st.tuples(*strange)
    return Case(contents, files, (lambda: read_terrain(files[0], 1.0),))


def of_bag(run: Path) -> Case:
    """A recording is a bag with grids."""
    file, maps = run / "recording.mcap", run / "maps"

    def read() -> None:
        try:
            extract_map(file, maps, "/map")
        finally:
            shutil.rmtree(maps, ignore_errors=True)

    return case(strange_files.strange_bytes(file.read_bytes()), file, read)


def of_sweep(run: Path) -> Case:
    line = b'{"key":"k","case":"c","seed":1,"outcome":"ok","error":null,"metrics":{"a":1.5},"trace_hash":null,'
    line += b'"wall_s":1.0,"software":"0","settings":{}}\n'
    files = run / "sweep.yaml", run / FILE

    def read() -> None:
        with open_results(run):
            pass

    contents = st.tuples(strange_files.strange_bytes(SWEEP.encode()), strange_files.strange_bytes(line * 3))
    return Case(contents, files, (lambda: read_plan(files[0]), read))


def of_key_or_access(run: Path) -> Case:
    access = {"fleet": "yards-1", "router": "tcp/127.0.0.1:7447", "token": "t" * 32}
    contents = st.binary(max_size=200) | strange_files.strange_value(access).map(as_json)
    file = run / "file"
    return case(contents, file, lambda: fleet_key(file), lambda: read_access(file, "--access"))


@often
@pytest.mark.parametrize("make", [of_journal, of_summary, of_scenario, of_map, of_bag, of_sweep, of_key_or_access])
def test_no_file_gives_anything_but_a_value_or_a_line(
    make: Callable[[Path], Case], examples: int, strange: Path
) -> None:
    tried = make(strange)

    @fuzz(max_examples=examples)
    @given(tried.contents)
    def check(contents: tuple[bytes, ...]) -> None:
        for file, content in zip(tried.files, contents, strict=True):
            file.write_bytes(content)
        for read in tried.reads:
            value_or_line(read)

    check()


@often
def test_no_record_gives_anything_but_a_value_or_a_value_error(examples: int, run_folder: Path) -> None:
    payloads = strange_files.records_of((run_folder / "journal").read_bytes())

    @fuzz(max_examples=10 * examples)
    @given(st.sampled_from(payloads).flatmap(strange_files.strange_bytes) | st.binary(max_size=64))
    def check(payload: bytes) -> None:
        with suppress(ValueError):
            unpack(payload)

    check()


def test_every_place_of_a_tick_is_checked(strange: Path) -> None:
    """Each strange value in each place of a tick, an event, the header and the end."""
    payloads = strange_files.records_of((strange / "journal").read_bytes())
    ticks = [one for one in payloads if one[1:11] == b"\xa4type\xa4tick"]
    chosen = [ticks[len(ticks) // 2], *[one for one in payloads if one not in ticks][1:3], payloads[-1]]
    for payload in chosen:
        record = msgpack.unpackb(payload, strict_map_key=False)
        for place in strange_files.places_in(record):
            for value in strange_files.VALUES:
                with suppress(ValueError):
                    unpack(msgpack.packb(strange_files.changed(record, place, value)))
