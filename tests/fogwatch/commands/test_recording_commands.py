import errno
import fcntl
import io
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pandas as pd
import pytest
from rich.console import Console

import fogwatch
from fogwatch.run_folder.derived import derive
from fogwatch.terminal.live_table import PlainDisplay, RunDisplay
from patrol.journal import read_journal
from patrol.prepare import prepare
from patrol.scenario import load_scenario
from patrol.summary.model import Summary
from runtime.process.lifeline import InterruptedBySignal
from tests.fleets import COARSE, python
from tests.fogwatch.conftest import Refused, Shell, cut_off
from tests.recordings import decoded

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


def test_a_recording_is_written_again(ran: Path, shell: Shell, tmp_path: Path) -> None:
    assert "15 s, a whole grid every 10 s" in shell("record", ran, "--out", "a.mcap").out
    assert (tmp_path / "a.mcap").read_bytes() == (ran / "recording.mcap").read_bytes()
    assert decoded(tmp_path / "a.mcap")["/mfow"][-1][0] == 14.5


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


def test_a_comparison_that_takes_long_says_how_far_it_is(
    ran: Path, shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fogwatch.commands.report.PROGRESS_S", 0.0)
    lines = shell("compare", ran, ran, "--out", "both.html").err.splitlines()
    assert [line for line in lines if line.startswith("comparing: ")] == [
        "comparing: 0 of 2 runs are read",
        "comparing: 1 of 2 runs are read",
    ]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["report", "."], "holds no file journal"),
        (["record", "."], "holds no file journal"),
        (["judge", "nowhere"], "no such folder"),
        (["report", "RUN/recording.mcap"], "is a file; name the run's folder"),
        (["record"], "name a run's folder, or --router and --fleet"),
        (["record", "RUN", "--fleet", "x", "--router", "tcp/127.0.0.1:1"], "name a run's folder, or --router"),
        (["record", "RUN", "--router", "tcp/127.0.0.1:1"], "name a run's folder, or --router"),
        (["record", "RUN", "--fleet", "x"], "name a run's folder, or --router"),
        (["monitor", "RUN", "--router", "tcp/127.0.0.1:1"], "name a run's folder, or --router"),
        (["monitor", "RUN", "--fleet", "x"], "name a run's folder, or --router"),
        (["record", "RUN", "--scenario", "x.yaml"], "leave the folder out"),
        (["compare", "RUN"], "one run cannot be compared"),
        (["compare", "RUN", "nowhere"], "no such folder"),
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

    monkeypatch.setattr("fogwatch.cli.open_run.warm", never)
    monkeypatch.setattr("runtime.starting.warmup.warm", never)
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

    class Interrupting(RunDisplay):
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


NAMES = ("ticks", "robots", "links", "events", "visits", "ground")


@pytest.mark.parametrize(("kind", "read"), [("parquet", pd.read_parquet), ("csv", pd.read_csv)])
def test_it_writes_a_file_a_table(ran: Path, shell: Shell, tmp_path: Path, kind: str, read: Any) -> None:
    files = [f"{name}.{kind}" for name in NAMES]
    said = f"tables: some/tables: {', '.join(files)}\n"
    assert shell("export", ran, "--format", kind, "--out", "some/tables")[:2] == (0, said)
    assert sorted(file.name for file in (tmp_path / "some/tables").iterdir()) == sorted(files)
    ticks = read(tmp_path / "some" / "tables" / f"ticks.{kind}")
    assert ticks.mfow_s.tolist() == fogwatch.load(ran).mfow_s.tolist()


def test_a_run_without_an_end_is_exported_as_far_as_it_goes(ran: Path, shell: Shell, tmp_path: Path) -> None:
    folder = cut_off(ran, tmp_path / "half")
    said = shell("export", folder)
    assert said.code == 0
    assert "was cut off" in said.err
    ticks = pd.read_parquet(folder / "tables" / "ticks.parquet")
    whole = fogwatch.load(ran).ticks.to_pandas()
    assert 0 < len(ticks) < len(whole)
    pd.testing.assert_frame_equal(ticks, whole[: len(ticks)])


def test_bad_arguments_of_an_export_are_named(ran: Path, refused: Refused, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    assert "--format xlsx: known are parquet, csv" in refused("export", ran, "--format", "xlsx")
    assert "--out file: is a file; name a folder" in refused("export", ran, "--out", "file")
    assert "nothing: no such folder; name the folder of a run" in refused("export", "nothing")


def test_tables_do_not_follow_a_link_out_of_the_folder(ran: Path, shell: Shell, tmp_path: Path) -> None:
    folder = cut_off(ran, tmp_path / "half")
    (tmp_path / "elsewhere").mkdir()
    (folder / "tables").symlink_to(tmp_path / "elsewhere")
    said = shell("export", folder)
    assert said.code == 2
    assert "is a link that leads out of the run's folder; name a folder with --out" in said.err
    assert not list((tmp_path / "elsewhere").iterdir())


INTERRUPTED = """
import os, signal, sys
from monitor.tables import arrow as files
from fogwatch.cli.app import main

write = files.write_tables

def interrupted(run, folder, kind, **options):
    def share(done):
        if done > 0.4:
            os.kill(os.getpid(), signal.{name})
        options["share"](done)
    return write(run, folder, kind, share=share)

files.write_tables = interrupted
sys.argv = ["fogwatch", "export", *sys.argv[1:]]
sys.exit(main())
"""


@pytest.mark.processes
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_signal_leaves_no_half_file(ran: Path, tmp_path: Path, name: str) -> None:
    program = INTERRUPTED.replace("{name}", name)
    wide = {**os.environ, "COLUMNS": "200"}
    done = python("-c", program, ran, "--out", tmp_path / "tables", env=wide)
    assert done.returncode == 130, done.stderr
    assert "Traceback" not in done.stderr
    assert not list((tmp_path / "tables").iterdir())


def full_disk(*_: object) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_replay_as_a_folder_needs_a_new_one_and_serves_nothing(
    ran: Path, shell: Shell, refused: Refused, tmp_path: Path
) -> None:
    assert "30 frames" in shell("replay", ran, "--static", "page").out
    files = ["icon.svg", "index.html", "page.css", "palette.css", "plotly.min.js", "run.js"]
    assert sorted(file.name for file in (tmp_path / "page").iterdir()) == files
    before = (tmp_path / "page" / "run.js").read_bytes()
    assert "page: exists already; name a new or an empty folder" in shell("replay", ran, "--static", "page").err
    assert (tmp_path / "page" / "run.js").read_bytes() == before
    assert "30 and 30 frames" in shell("replay", ran, ran, "--static", "pair").out
    assert sorted(file.name for file in (tmp_path / "pair" / "second").iterdir()) == files
    assert "replay: 3 runs were named; name one, or two" in refused("replay", ran, ran, ran)
    refused("replay", ran, ran, tmp_path, "--static", "other")
    assert f"{tmp_path}: holds no file journal" in refused("replay", ran, tmp_path)
    assert "--static other: serves nothing; leave out" in refused("replay", ran, "--static", "other", "--browser")
    assert "--token" in refused("replay", ran, "--static", "other", "--token", "t" * 32)
    assert not (tmp_path / "other").exists()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Path, "rename", full_disk)
        shown = shell("replay", ran, "--static", "other")
    assert shown.code == 2
    assert "other: cannot be written (No space left on device); choose another folder" in shown.err
    assert list((tmp_path / "other").iterdir()) == []
