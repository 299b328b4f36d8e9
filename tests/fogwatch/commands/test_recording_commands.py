from __future__ import annotations

import fcntl
import io
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import unquote

import pytest
from rich.console import Console

import fogwatch
from fogwatch.run_folder.derived import derive
from fogwatch.terminal.live_table import PlainDisplay, SilentDisplay
from patrol.journal import read_journal
from patrol.prepare import prepare
from patrol.process.lifeline import InterruptedBySignal
from patrol.scenario import load_scenario
from patrol.summary.model import Summary
from tests.fleets import COARSE
from tests.fogwatch.conftest import Refused, Shell, cut_off

SMALL = {**COARSE, "name": "small", "duration": 15, "robots": {"count": 2, "model": "holonomic"}}


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with a recording and a report; nobody changes it."""
    return fogwatch.run(SMALL, out=tmp_path_factory.mktemp("run") / "small", recording=True, report=True).folder


@contextmanager
def written(folder: Path) -> Iterator[None]:
    """The journal's writer lives."""
    with (folder / "journal").open("rb") as journal:
        fcntl.flock(journal, fcntl.LOCK_EX)
        yield


def test_a_run_leaves_a_recording_and_a_report(ran: Path) -> None:
    assert (ran / "recording.mcap").read_bytes()[1:5] == b"MCAP"
    page = (ran / "report.html").read_text(encoding="utf-8")
    assert ">valid</span>" in page
    assert 'href="recording.mcap"' in page
    assert not list(ran.glob("*.part"))


def test_a_recording_is_written_checked_and_repaired(ran: Path, shell: Shell, tmp_path: Path) -> None:
    assert "15 s, a whole grid every 10 s" in shell("record", ran, "--out", "a.mcap").out
    assert (tmp_path / "a.mcap").read_bytes() == (ran / "recording.mcap").read_bytes()
    said = shell("record", "--check", "a.mcap")
    assert said.code == 0
    assert "small: 0 to 14.5 s" in said.out
    assert "complete, checksums right" in said.out
    (tmp_path / "b.mcap").write_bytes((tmp_path / "a.mcap").read_bytes()[:-200])
    said = shell("record", "--check", "b.mcap")
    assert said.code == 1
    assert "cut off" in said.out
    assert shell("record", "--check", "b.mcap", "--repair", "c.mcap").code == 0
    assert shell("record", "--check", "c.mcap").code == 0


def test_what_can_be_shown_of_a_run_without_an_end(ran: Path, shell: Shell, tmp_path: Path) -> None:
    """It goes on while its journal's writer lives, also where that was paused long ago, and no moment longer."""
    folder = cut_off(ran, tmp_path / "half")
    os.utime(folder / "journal", (1.0e9, 1.0e9))
    with written(folder):
        said = shell("record", folder)
        assert said.code == 0
        assert "is still going" in said.err
        assert shell("report", folder).code == 0
        assert "The run is still going" in (folder / "report.html").read_text(encoding="utf-8")
    said = shell("record", folder)
    assert said.code == 0
    assert "was cut off" in said.err
    assert (folder / "recording.mcap").exists()


def test_report_and_compare(ran: Path, shell: Shell, tmp_path: Path) -> None:
    folder = cut_off(ran, tmp_path / "half")
    shown = shell("report", folder, "--figures", "figures")
    assert shown.code == 0
    assert "was cut off" in shown.err
    assert "figures: figures: mfow, states" in shown.out
    assert (folder / "report.html").exists()
    names = {path.stem for path in (tmp_path / "figures").iterdir()}
    assert {"mfow", "fog-mean", "fog-worst", "gaps", "paths", "links", "decisions", "troubles"} <= names
    shown = shell("compare", ran, folder, "--out", "both.html")
    assert shown.code == 0
    for line in ("small", "half", "mean MFoW", "not judged", "comparison: both.html"):
        assert line in shown.out
    assert "<svg" in (tmp_path / "both.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["report", "."], "holds no file journal"),
        (["record", "."], "holds no file journal"),
        (["report", "RUN/recording.mcap"], "fogwatch record --check"),
        (["report", "RUN/journal"], "is a file"),
        (["record", "--check", "RUN/journal"], "is not an MCAP file"),
        (["record", "--check", "RUN"], "is a folder; name a file, such as"),
        (["record", "--check"], "FILE.mcap is missing; for example: fogwatch record --check yards.mcap"),
        (["record", "--check", "a.mcap", "--fleet", "x"], "--check: records nothing; leave --out and"),
        (["record", "RUN", "--repair", "b.mcap"], "--repair b.mcap: mends a recording that is there; add --check"),
        (["record"], "name a run's folder, or --router and --fleet"),
        (["record", "RUN", "--fleet", "x", "--router", "tcp/127.0.0.1:1"], "name a run's folder, or --router"),
        (["record", "RUN", "--router", "tcp/127.0.0.1:1"], "name a run's folder, or --router"),
        (["record", "RUN", "--fleet", "x"], "name a run's folder, or --router"),
        (["monitor", "RUN", "--router", "tcp/127.0.0.1:1"], "name a run's folder, or --router"),
        (["monitor", "RUN", "--fleet", "x"], "name a run's folder, or --router"),
        (["record", "RUN", "--scenario", "x.yaml"], "leave the folder out"),
        (["compare", "RUN"], "one run cannot be compared"),
        (["record", "RUN", "--out", "none/a.mcap"], "cannot be written"),
        (["record", "RUN", "--out", "."], "is a folder; name a file, such as recording.mcap"),
        (["record", "RUN", "--out", "/"], "is a folder; name a file"),
        (["record", "--router", "tcp/127.0.0.1:1", "--fleet", "x", "--out", "."], "is a folder; name a file"),
        (["report", "RUN", "--out", "."], "is a folder; name a file, such as report.html"),
        (["report", "RUN", "--out", "none/a.html"], "cannot be written"),
        (["compare", "RUN", "RUN", "--out", ".."], "is a folder; name a file, such as ../compare.html"),
        (["monitor", "typo"], "monitor typo: no such folder"),
        (["monitor", "RUN"], "fogwatch replay RUN"),
        (["monitor", "RUN/journal"], "no such folder"),
    ],
)
def test_bad_input_is_one_line(ran: Path, refused: Refused, arguments: list[str], words: str) -> None:
    before = set(ran.parent.iterdir())
    said = refused(*(part.replace("RUN", str(ran)) for part in arguments))
    assert words.replace("RUN", str(ran)) in said
    assert set(ran.parent.iterdir()) == before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        *((f"{command} nowhere", "no such folder") for command in ("report", "record", "replay")),
        *((f"{command} --out .", "is a folder") for command in ("report RUN", "record RUN", "compare RUN RUN")),
    ],
)
def test_folders_are_looked_at_before_anything_is_compiled(
    ran: Path, refused: Refused, monkeypatch: pytest.MonkeyPatch, arguments: str, words: str
) -> None:
    def never(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr("fogwatch.run_folder.reading.warm", never)
    monkeypatch.setattr("patrol.starting.warmup.warm", never)
    assert words in refused(*(part.replace("RUN", str(ran)) for part in arguments.split()))


def test_the_files_of_a_report_are_found_from_where_it_lies(ran: Path, shell: Shell, tmp_path: Path) -> None:
    place = tmp_path / "a b" / "deep"
    place.mkdir(parents=True)
    assert shell("report", ran, "--out", place / "elsewhere.html").code == 0
    page = (place / "elsewhere.html").read_text(encoding="utf-8")
    files = re.findall(r'<a href="([^"#]+)"', page)
    assert len(files) >= 4
    assert all((place / unquote(file)).resolve().parent == ran.resolve() for file in files)
    assert all((place / unquote(file)).is_file() for file in files)


@pytest.mark.parametrize("at", [3, 30])
def test_an_interruption_leaves_neither_file_nor_parts_of_one(ran: Path, tmp_path: Path, at: int) -> None:
    """Early in the replay, and after its last tick."""

    class Interrupting(SilentDisplay):
        calls = 0

        def progress(self, *_: object) -> None:
            if self.calls == at:
                raise InterruptedBySignal
            self.calls += 1

    files = (tmp_path / "a.mcap", tmp_path / "report.html")
    with pytest.raises(InterruptedBySignal):
        derive(read_journal(ran / "journal"), prepare(load_scenario(SMALL)), Summary(), *files, Interrupting())
    assert not list(tmp_path.iterdir())


def test_what_cannot_be_written_is_no_reason_to_doubt_the_run(ran: Path, tmp_path: Path) -> None:
    text = io.StringIO()
    files = (tmp_path / "none" / "a.mcap", None)
    display = PlainDisplay(Console(file=text, width=80))
    derive(read_journal(ran / "journal"), prepare(load_scenario(SMALL)), Summary(), *files, display)
    assert "cannot be written" in text.getvalue()
