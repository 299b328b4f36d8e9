"""A run that is judged again: the verdict of its journal, and where its summary says something else."""

import json
import math
import shutil
import struct
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgpack
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import fogwatch
from patrol.journal import End, JournalWriter, Record, TickRecord, read_journal, trace_hash
from patrol.journal.file import MAGIC
from tests.fleets import COARSE
from tests.fogwatch.conftest import Refused, Shell
from worldsim.run_record import COMPLETED, INTERRUPTED

Judging = Callable[[Path], tuple[int, Any]]

SMALL = {**COARSE, "name": "small", "duration": 10, "seed": 1, "robots": {"count": 2, "model": "holonomic"}}
SMALL["faults"] = [{"kind": "loss", "rate": 0.3}]


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run; nobody changes it."""
    return fogwatch.run(SMALL, out=tmp_path_factory.mktemp("run") / "small", picture=False).folder


@pytest.fixture
def folder(ran: Path, tmp_path: Path) -> Path:
    """A copy of the run, for changes."""
    return Path(shutil.copytree(ran, tmp_path / "small"))


@pytest.fixture
def judged(shell: Shell) -> Judging:
    """Judges a run; the exit code, and what is printed as JSON."""

    def call(folder: Path) -> tuple[int, Any]:
        said = shell("judge", folder, "--json")
        return said.code, json.loads(said.out)

    return call


def edit_summary(folder: Path, change: Callable[[dict[str, Any]], None]) -> None:
    file = folder / "summary.json"
    summary = json.loads(file.read_text(encoding="utf-8"))
    change(summary)
    file.write_text(json.dumps(summary), encoding="utf-8")


def edit_journal(
    folder: Path,
    change: Callable[[list[TickRecord]], Iterable[TickRecord]] = lambda ticks: ticks,
    notes: Mapping[str, Any] | None = None,
    reason: str = COMPLETED,
) -> None:
    """Write the run's journal anew: with other ticks and the trace hash that belongs to them, notes, or end."""
    file = folder / "journal"
    journal = read_journal(file)
    ticks, events = list(change(list(journal.ticks))), journal.events
    assert journal.end is not None
    file.unlink()
    with JournalWriter(file, journal.header) as writer:
        noted = journal.end.notes if notes is None else notes
        records: list[Record] = [*ticks, *events, End(reason, trace_hash(ticks), noted)]
        for record in records:
            writer.write(record)


def fields_of(said: Any) -> set[str]:
    return {difference["field"] for difference in said["differences"]}


def failed_of(said: Any) -> set[str]:
    return {check["name"] for check in said["verdict"]["checks"] if not check["ok"]}


def test_an_unchanged_run_gets_its_verdict_again(ran: Path, judged: Judging, shell: Shell) -> None:
    before = {file: file.read_bytes() for file in ran.rglob("*") if file.is_file()}
    code, said = judged(ran)
    stated = json.loads((ran / "summary.json").read_text(encoding="utf-8"))
    assert code == 0
    assert said["verdict"] == stated["verdict"]
    assert said["trace_hash"] == stated["trace_hash"]
    assert said["summary_agrees"] is said["scenario_agrees"] is True
    code, printed, _ = shell("judge", ran)
    assert code == 0
    assert "verdict     valid" in printed
    assert stated["trace_hash"] in printed
    assert "agrees with the journal in every field" in printed
    assert "exit codes  none: the run was in one process" in printed
    assert before == {file: file.read_bytes() for file in ran.rglob("*") if file.is_file()}


def test_exit_codes_of_processes_that_no_summary_states_are_unknown(folder: Path, shell: Shell) -> None:
    edit_journal(folder, notes={"wall_s": 1.0, "refused": {}})
    assert "exit codes  none are known: how processes ended was not judged" in shell("judge", folder).out


def test_values_that_were_changed_in_the_summary(folder: Path, judged: Judging) -> None:
    edit_summary(folder, lambda summary: summary["verdict"].update(outcome="invalid", valid=False))
    edit_summary(folder, lambda summary: summary.update(mfow_mean_s=summary["mfow_mean_s"] - 1e-6))
    code, said = judged(folder)
    assert (code, said["verdict"]["outcome"]) == (1, "valid")
    (mfow,) = [one for one in said["differences"] if one["field"] == "mfow_mean_s"]
    assert mfow["found"] == said["mfow_mean_s"] > mfow["stated"]
    assert fields_of(said) == {"verdict.outcome", "verdict.valid", "mfow_mean_s"}


def test_another_trace_hash_in_the_summary(folder: Path, judged: Judging, shell: Shell) -> None:
    edit_summary(folder, lambda summary: summary.update(trace_hash="0" * 64))
    code, said = judged(folder)
    assert (code, fields_of(said)) == (1, {"trace_hash"})
    assert said["trace_hash"] == read_journal(folder / "journal").end.trace_hash  # type: ignore[union-attr]
    code, printed, _ = shell("judge", folder)
    assert code == 1
    assert "disagrees with the journal in 1 field\n" in printed


def test_a_recovery_that_failed_is_not_repeated(folder: Path, judged: Judging, shell: Shell) -> None:
    def failed(summary: dict[str, Any]) -> None:
        verdict = summary["verdict"]
        verdict.update(outcome="invalid", valid=False)
        (recovery,) = [check for check in verdict["checks"] if check["name"] == "recovery"]
        recovery.update(ok=False, judged=True, detail="not every point was seen again; at most 9 s are allowed")

    edit_summary(folder, failed)
    code, said = judged(folder)
    assert (code, said["differences"], said["not_repeated"]) == (0, [], ["recovery"])
    code, printed, _ = shell("judge", folder)
    assert code == 0
    assert "not repeated: recovery" in printed


def test_a_tick_less_in_the_journal(folder: Path, judged: Judging) -> None:
    edit_journal(folder, lambda ticks: [*ticks[:7], *ticks[8:]])
    code, said = judged(folder)
    assert (code, said["verdict"]["outcome"]) == (1, "invalid")
    assert "complete" in failed_of(said)
    assert {"ticks", "trace_hash", "verdict.outcome"} <= fields_of(said)


def test_an_end_that_came_early_is_named(folder: Path, judged: Judging, shell: Shell) -> None:
    """A journal that was cut like this is as good as that of a run which was interrupted there."""
    (folder / "summary.json").unlink()
    edit_journal(folder, lambda ticks: ticks[:8], reason=INTERRUPTED)
    code, said = judged(folder)
    assert (code, said["verdict"]["outcome"], said["ended"]) == (0, "valid", "interrupted")
    assert (said["simulated_s"], said["duration_s"]) == (4.0, 10.0)
    assert "ended       early, after 4 s of 10 s: interrupted\n" in shell("judge", folder).out


def test_another_pose_in_the_journal(folder: Path, judged: Judging) -> None:
    def moved(ticks: list[TickRecord]) -> list[TickRecord]:
        first, *others = ticks[9].robots
        return [*ticks[:9], replace(ticks[9], robots=(replace(first, x=first.x + 1.0), *others)), *ticks[10:]]

    edit_journal(folder, moved)
    code, said = judged(folder)
    assert code == 1
    assert {"moves", "frames"} <= failed_of(said)
    assert "trace" not in failed_of(said), "its hash was made to agree"
    assert "verdict.outcome" in fields_of(said)


@pytest.mark.parametrize(
    ("old", "new", "failed"),
    [("seed: 1", "seed: 2", {"radio"}), ("unpredictability: 1.0", "unpredictability: 0.5", set())],
)
def test_another_scenario(folder: Path, judged: Judging, old: str, new: str, failed: set[str]) -> None:
    """A change that no check can notice, as of what robots think, is one all the same."""
    file = folder / "scenario.yaml"
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new), encoding="utf-8")
    code, said = judged(folder)
    assert code == 1
    assert said["scenario_agrees"] is False
    assert failed <= failed_of(said)
    assert bool(failed) == bool(failed_of(said))


def test_a_run_that_was_cut_off_is_unknown(folder: Path, shell: Shell) -> None:
    file = folder / "journal"
    file.write_bytes(file.read_bytes()[:-200])
    (folder / "summary.json").unlink()
    assert shell("judge", folder).code == 3


@pytest.mark.parametrize(
    ("notes", "field"),
    [
        ({"wall_s": "long"}, "notes.wall_s"),
        ({"wall_s": -1.0}, "notes.wall_s"),
        ({"wall_s": math.inf}, "notes.wall_s"),
        ({"slipped_s": None}, "notes.slipped_s"),
        ({"late_commands": 5}, "notes.late_commands"),
        ({"late_commands": {"r1": 5}}, "notes.late_commands.r1.[key]"),
        ({"too_late": {1: b"many"}}, "notes.too_late.1"),
        ({"refused": [1]}, "notes.refused"),
        ({"refused": {"stranger": 0.5}}, "notes.refused.stranger"),
        ({"direct": []}, "notes.direct"),
        ({"direct": {"missed": {"r1": "some"}}}, "notes.direct.missed.r1"),
        ({"direct": {"said": {"r1": 1}}}, "notes.direct.said.r1"),
        (
            {"direct": {"said": {"r1": {"heard": {}, "sent": 1, "refused": 0, "final": 1}}}},
            "notes.direct.said.r1.final",
        ),
    ],
)
def test_notes_of_another_kind_are_bad_input(folder: Path, shell: Shell, notes: Any, field: str) -> None:
    edit_journal(folder, notes=notes)
    said = shell("judge", folder)
    assert said.code == 2
    assert f"({field}: Input should be" in said.err


def test_notes_about_robots_of_no_roster_are_left_out(folder: Path, judged: Judging) -> None:
    edit_journal(folder, notes={"wall_s": 2.0, "late_commands": {1: 3, 99: 1}})
    _, said = judged(folder)
    assert fields_of(said) == {"wall_s", "realtime_factor"}


STRANGE: tuple[Any, ...] = (
    *(0, 1, -1, 2, 7, 99, 70_000, 2**31, 2**63, 0.5, -1e300, math.nan, math.inf, True, None, "", "loss:f9", b"\x00"),
    *([], {}, [1], [[1, 2]]),
)


def leaves(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The ways to all values inside of a value."""
    if path:
        yield path
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, part in parts:
        yield from leaves(part, (*path, key))


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_journal_with_one_strange_value_is_judged_or_refused(ran: Path, shell: Shell, data: st.DataObject) -> None:
    """Its checksums are right."""
    whole = (ran / "journal").read_bytes()
    payloads, at = [], len(MAGIC)
    while at < len(whole):
        length, _ = struct.unpack_from("<II", whole, at)
        payloads.append(whole[at + 8 : at + 8 + length])
        at += 8 + length
    number = data.draw(st.one_of(st.just(0), st.integers(0, len(payloads) - 1)), label="record")
    record = msgpack.unpackb(payloads[number], strict_map_key=False)
    path = data.draw(st.sampled_from(list(leaves(record))), label="path")
    holder = record
    for key in path[:-1]:
        holder = holder[key]
    holder[path[-1]] = data.draw(st.sampled_from(STRANGE), label="value")
    payloads[number] = msgpack.packb(record)
    with TemporaryDirectory() as place:
        folder = Path(shutil.copytree(ran, Path(place) / "run"))
        framed = [struct.pack("<II", len(packed), zlib.crc32(packed)) + packed for packed in payloads]
        (folder / "journal").write_bytes(MAGIC + b"".join(framed))
        said = shell("judge", folder)
        assert "Traceback" not in said.err
        assert said.code in (0, 1, 2) or (said.code == 3 and "unknown" in said.out), said


def test_nothing_of_the_folder_is_executed(folder: Path, judged: Judging) -> None:
    """The policy that a stranger's scenario names leaves a mark where it is imported."""
    mark = folder.parent / "executed"
    (folder / "policy.py").write_text(f"open({str(mark)!r}, 'w')\n", encoding="utf-8")
    file = folder / "scenario.yaml"
    text = file.read_text(encoding="utf-8")
    changed = text.replace("policy: stochastic", "policy: ./policy.py:Bad")
    assert changed != text
    file.write_text(changed, encoding="utf-8")
    code, said = judged(folder)
    assert (code, said["scenario_agrees"]) == (1, False)
    assert not mark.exists()


def test_report_and_compare_say_where_a_summary_disagrees(ran: Path, folder: Path, shell: Shell) -> None:
    edit_summary(folder, lambda summary: summary.update(mfow_mean_s=1.0, trace_hash="0" * 64))
    said = shell("report", folder)
    assert said.code == 0
    for words in ("mfow_mean_s = 1.0", "trace_hash", "fogwatch judge"):
        assert words in said.err
    assert "states mfow_mean_s = 1.0" in (folder / "report.html").read_text(encoding="utf-8")
    said = shell("compare", ran, folder)
    assert said.code == 0
    assert "mfow_mean_s = 1.0" in said.err
    assert read_journal(ran / "journal").end.trace_hash[:16] in said.out  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("old", "new", "wrong"),
    [
        ('"mfow_mean_s": ', '"mfow_mean_s": 1e999, "was": ', "mfow_mean_s is too large for a number"),
        ('"ticks": ', f'"ticks": 1{"0" * 400}, "was": ', "ticks is too large for a number"),
        ('"ticks": ', f'"ticks": 1{"0" * 9000}, "was": ', "ticks is too large for a number"),
        ('"mfow_mean_s": ', '"mfow_mean_s": "1e999", "was": ', "mfow_mean_s"),
        ('"mfow_mean_s": ', '"other": [[1e999]], "mfow_mean_s": ', "other.0.0 is too large"),
        ('"name": "small"', '"name": "\\ud800"', r'name = "\ud800": holds half of a character'),
        ('"name": "small"', '"\\udfff": 1, "name": "small"', "half of a character"),
        ('"outcome": "valid"', '"outcome": "\\ud800"', "verdict.outcome"),
    ],
)
@pytest.mark.parametrize("asked", ["report", "judge", "compare"])
def test_a_summary_with_impossible_values_is_bad_input(
    ran: Path, folder: Path, refused: Refused, asked: str, old: str, new: str, wrong: str
) -> None:
    file = folder / "summary.json"
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    line = refused(asked, folder, *([ran] if asked == "compare" else []))
    assert "summary.json" in line
    assert wrong in line
