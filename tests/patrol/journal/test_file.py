import os
import signal
import struct
import subprocess
import sys
import tracemalloc
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgpack
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from patrol.errors import BadInput
from patrol.journal import (
    End,
    Event,
    Header,
    JournalWriter,
    Record,
    RobotFacts,
    RobotTick,
    Status,
    TerrainFacts,
    TickRecord,
    read_journal,
)
from patrol.journal.file import MAGIC
from patrol.journal.links import drops_of, links_of
from patrol.journal.records import FARTHEST
from patrol.scenario import as_mapping, load_scenario
from tests.full_disk import full_disk

HEADER = Header(
    software="0.1.0",
    scenario=as_mapping(load_scenario({"terrain": {"builtin": "yards"}})),
    scenario_hash="ab" * 32,
    robots=(RobotFacts(1, "r1", "car", 1.0), RobotFacts(2, "scout", "holonomic", 0.3)),
    terrain=TerrainFacts("yards", 1000, 880, 0.1, (-1.5, 0.0)),
    patrolled_area_m2=6837.25,
    bound_s=16.4,
    started="2026-01-01T12:00:00+00:00",
)


def test_a_record_that_could_not_be_written_leaves_nothing_of_itself(tmp_path: Path) -> None:
    with JournalWriter(tmp_path / "journal", HEADER) as writer:
        writer.write(tick(0))
        most = (tmp_path / "journal").stat().st_size + 50
        with full_disk(most), pytest.raises(OSError, match="File too large"):
            writer.write(tick(1))
        journal = read_journal(tmp_path / "journal")
        assert (list(journal.ticks), journal.truncated) == ([tick(0)], False)
        writer.write(tick(1))  # there is room again
    assert list(read_journal(tmp_path / "journal").ticks) == [tick(0), tick(1)]


ROW = RobotTick(1, Status.ALIVE, 0.0, -0.0, 1e-300, 4.4, -1 / 3, False, "patrolling", (1.5, 2.5), 0.7, 0)


def tick(k: int, robots: int = 2) -> TickRecord:
    numbers = range(1, robots + 1)
    return TickRecord(
        k=k,
        robots=tuple(replace(ROW, number=n, x=0.1 * k + n, bumped=k % 2 == 1) for n in numbers),
        frames=tuple((n, bytes([n]) * 20) for n in numbers),
        deliveries=tuple((a, b, k) for a in numbers for b in numbers if a != b),
        dropped=((1, 2, k, "paused"),),
        mfow=k,
        fog_mean=k / 3,
        seen=17 * k,
    )


def write(path: Path, *records: Record, header: Header = HEADER) -> Path:
    with JournalWriter(path, header) as journal:
        for record in records:
            journal.write(record)
    return path


places = st.floats(-FARTHEST, FARTHEST)
numbers = st.floats(-1e12, 1e12)
finite = st.floats(allow_nan=False, allow_infinity=False)
links = st.tuples(st.integers(0, 2), st.integers(1, 2), st.integers(0, 2))
causes = st.sampled_from(["dead", "range:f1"])
fates = st.lists(st.tuples(st.integers(0, 2), st.integers(1, 2), st.integers(1, 3), causes), max_size=8).map(tuple)
robot_ticks = st.builds(
    RobotTick,
    number=st.just(1),
    status=st.sampled_from(Status),
    x=places,
    y=places,
    heading=numbers,
    c0=numbers,
    c1=numbers,
    bumped=st.booleans(),
    state=st.sampled_from(["", "patrolling", "dead-end"]),
    goal=st.none() | st.tuples(finite, finite),
    decision_ms=st.none() | numbers,
    rejected=st.none() | st.integers(0, 2**40),
)
tick_records = st.builds(
    TickRecord,
    k=st.integers(0, 2**31),
    robots=st.tuples(robot_ticks, robot_ticks.map(lambda row: replace(row, number=2))),
    frames=st.lists(st.tuples(st.integers(0, 2), st.binary(max_size=64)), max_size=3).map(tuple),
    deliveries=st.lists(links, max_size=8).map(tuple),
    dropped=fates,
    mfow=st.integers(0, 2**31),
    fog_mean=st.floats(0.0, 1e12),
    seen=st.integers(0, 2**40),
    copies=fates,
    delayed=fates,
    forged=st.lists(st.sampled_from(["f1", "f2"]), max_size=2).map(tuple),
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(tick_records, max_size=3))
def test_what_is_written_is_read_to_the_bit(tmp_path: Path, ticks: list[TickRecord]) -> None:
    path = tmp_path / "journal"
    path.unlink(missing_ok=True)
    write(path, *ticks)
    read = list(read_journal(path).ticks)
    assert read == ticks
    # Equality calls -0.0 and 0.0 equal; their spelling does not.
    assert repr(read) == repr(ticks)


def test_links_in_columns_are_read_as_the_rows_that_they_were_made_of(tmp_path: Path) -> None:
    """One sender's frames of two ticks arrive in one tick, and a frame is lost for two reasons."""
    delivered = ((1, 2, 6), (1, 2, 7), (2, 1, 7))
    lost = ((1, 2, 4, "range:f1"), (1, 2, 5, "range:f1"), (1, 2, 5, "paused"), (2, 1, 5, "paused"))
    rows = replace(tick(7), deliveries=delivered, dropped=lost)
    columns = replace(rows, deliveries=links_of(delivered), dropped=drops_of(lost))
    (read,) = read_journal(write(tmp_path / "journal", columns)).ticks
    assert (tuple(read.deliveries), tuple(read.dropped)) == (delivered, lost)


def test_a_whole_run_is_read(tmp_path: Path) -> None:
    killed = Event(1, "killed", 2, "asked for by the timeline")
    end = End("duration", "cd" * 32, {"exit_codes": {"r1": 0}})
    journal = read_journal(write(tmp_path / "journal", tick(0), killed, tick(1), Event(2, "over"), end))
    assert journal.header == HEADER
    for _ in range(2):  # each pass begins anew
        assert [record.k for record in journal.ticks] == [0, 1]
    assert journal.events == (killed, Event(2, "over"))
    assert journal.end == end
    assert not journal.truncated
    assert load_scenario(journal.header.scenario).name == "yards"


def test_cut_off_at_any_byte_the_whole_records_are_read(tmp_path: Path) -> None:
    whole = write(tmp_path / "whole", tick(0), tick(1)).read_bytes()
    edges = [len(write(tmp_path / f"upto{n}", *map(tick, range(n))).read_bytes()) for n in range(3)]
    for length in range(edges[0], len(whole) + 1):
        cut = tmp_path / "cut"
        cut.write_bytes(whole[:length])
        journal = read_journal(cut)
        assert [record.k for record in journal.ticks] == [k for k in range(2) if edges[k + 1] <= length]
        assert journal.truncated == (length not in edges)
        assert journal.end is None


@pytest.mark.parametrize("damage", [0x01, 0xFF])
def test_nothing_after_a_damaged_record_is_trusted(tmp_path: Path, damage: int) -> None:
    path = write(tmp_path / "journal", tick(0), tick(1), tick(2))
    start = len(write(tmp_path / "one", tick(0)).read_bytes())
    for place in (start, start + 4, start + 8, start + 50):
        data = bytearray(path.read_bytes())
        data[place] ^= damage
        (tmp_path / "damaged").write_bytes(data)
        journal = read_journal(tmp_path / "damaged")
        assert [record.k for record in journal.ticks] == [0]
        assert journal.truncated


def test_a_journal_can_be_read_while_it_is_written_and_is_never_written_over(tmp_path: Path) -> None:
    path = tmp_path / "journal"
    with JournalWriter(path, HEADER) as writer:
        for k in range(3):
            writer.write(tick(k))
            assert [record.k for record in read_journal(path).ticks] == list(range(k + 1))
    with pytest.raises(FileExistsError):
        JournalWriter(path, HEADER)
    assert [record.k for record in read_journal(path).ticks] == [0, 1, 2]


def framed(value: object) -> bytes:
    payload = msgpack.packb(value)
    return struct.pack("<II", len(payload), zlib.crc32(payload)) + bytes(payload)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "is empty, so the run ended before it began; run it again"),
        (b"name: yards\n", "not a fogwatch journal"),
        (b"\x89PNG\r\n\x1a\n" * 100, "not a fogwatch journal"),
        (b"fogwatch journal 2\n", "another format, while this version reads format 1; use the version that wrote it"),
        (MAGIC, "no complete header"),
        (MAGIC + b"\xff\xff\xff\xff\x00\x00\x00\x00", "no complete header"),
        (MAGIC + framed({"type": "end", "reason": "", "trace_hash": "", "notes": {}}), "no complete header"),
        (MAGIC + framed({"type": "poem"}), "is damaged or of another version"),
        (MAGIC + framed([1, 2, 3]), "is damaged or of another version"),
        (MAGIC + framed("header"), "is damaged or of another version"),
        (MAGIC + framed({"type": "header", "robots": []}), "is damaged or of another version"),
        (MAGIC + framed({"type": "tick", "k": 1}), "is damaged or of another version"),
    ],
)
def test_other_files_are_bad_input(tmp_path: Path, content: bytes, says: str) -> None:
    path = tmp_path / "other"
    path.write_bytes(content)
    with pytest.raises(BadInput, match=says) as caught:
        read_journal(path)
    assert str(path) in str(caught.value)


def test_a_missing_file_and_a_folder_are_bad_input(tmp_path: Path) -> None:
    for path in (tmp_path / "none", tmp_path):
        with pytest.raises(BadInput, match="cannot be read"):
            read_journal(path)


@pytest.mark.processes
def test_a_killed_writer_loses_nothing_that_it_wrote(tmp_path: Path) -> None:
    path = tmp_path / "journal"
    code = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from pathlib import Path
from test_file import HEADER, JournalWriter, tick
journal = JournalWriter(Path({str(path)!r}), HEADER)
for k in range(1_000_000):
    journal.write(tick(k))
    print(k, flush=True)
"""
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        told = [int(child.stdout.readline()) for _ in range(200)]
        os.kill(child.pid, signal.SIGKILL)
        told += [int(line) for line in child.stdout.read().split("\n")[:-1]]
    journal = read_journal(path)
    ticks = [record.k for record in journal.ticks]
    assert ticks == list(range(len(ticks)))
    assert len(ticks) >= len(told)
    assert journal.end is None


def test_reading_streams(tmp_path: Path) -> None:
    """However long the file, a reader holds about one record."""
    twenty = replace(HEADER, robots=tuple(RobotFacts(n, f"r{n}", "car", 1.0) for n in range(1, 21)))
    ticks = (replace(tick(k, robots=20), dropped=()) for k in range(400))
    path = write(tmp_path / "journal", *ticks, header=twenty)
    tracemalloc.start()
    try:
        journal = read_journal(path)
        count = sum(1 for _ in journal.ticks)
        assert (count, journal.events, journal.end) == (400, (), None)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert path.stat().st_size > 1_000_000
    assert peak < 500_000


def test_a_tick_of_a_large_fleet_is_small(tmp_path: Path) -> None:
    """50 robots that all hear one another: 2450 deliveries in less than 10 kB."""
    sizes = [write(tmp_path / f"{n}", *(tick(k, robots=50) for k in range(n))).stat().st_size for n in (1, 11)]
    assert (sizes[1] - sizes[0]) / 10 < 10_000


def test_too_long_a_record_and_too_many_events_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("patrol.journal.file.longest_record", lambda _: 5000)
    with JournalWriter(tmp_path / "journal", HEADER) as journal:
        with pytest.raises(ValueError, match="longer"):
            journal.write(tick(0, robots=100))
        journal.write(tick(0))
    assert [record.k for record in read_journal(tmp_path / "journal").ticks] == [0]
    monkeypatch.setattr("patrol.journal.file.MOST_EVENTS", 3)
    events = tuple(Event(k, "over") for k in range(4))
    assert read_journal(write(tmp_path / "three", *events[:3])).events == events[:3]
    with pytest.raises(BadInput, match="more than 3 events"):
        _ = read_journal(write(tmp_path / "four", *events)).events


@pytest.mark.parametrize(
    ("strange", "says"),
    [
        ({"frames": ((99, b"x"),)}, "a frame of a robot that the header does not have"),
        ({"deliveries": ((99, 1, 3),)}, "links of a robot that the header does not have"),
        ({"robots": ()}, "rows of other robots than the header's"),
    ],
)
def test_a_tick_with_robots_that_the_header_does_not_have_is_refused(
    tmp_path: Path, strange: dict[str, Any], says: str
) -> None:
    path = write(tmp_path / "journal", tick(0), replace(tick(1), **strange))
    with pytest.raises(BadInput, match=rf"journal: record 2 is damaged or of another version \({says}\)"):
        list(read_journal(path).ticks)


def test_an_event_of_a_robot_that_the_header_does_not_have_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "journal", Event(0, "started", 9))
    with pytest.raises(BadInput, match="an event of robot 9"):
        assert read_journal(path).events


@pytest.mark.parametrize(
    ("strange", "says"),
    [
        ({"robots": HEADER.robots[::-1]}, "robots are not numbered 1, 2, ... in order"),
        ({"patrolled_area_m2": 0.0}, "patrolled_area_m2 = 0: less than a point"),
        ({"scenario": {**HEADER.scenario, "radio": None}}, "scenario.radio is missing or unusable"),
        ({"scenario": {**HEADER.scenario, "sensor": {}}}, "scenario.sensor.range is missing or unusable"),
        ({"scenario": {**HEADER.scenario, "step": True}}, "scenario.step is missing or unusable"),
        ({"scenario": {}}, "scenario.name is missing or unusable"),
    ],
)
def test_a_header_that_no_run_can_have_is_refused(tmp_path: Path, strange: dict[str, Any], says: str) -> None:
    with pytest.raises(BadInput, match=says):
        read_journal(write(tmp_path / "journal", header=replace(HEADER, **strange)))
