"""A run's tables from the command line: whole files or none, of whole runs and of killed ones."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

import fogwatch
from tests.fogwatch.commands.test_recording_commands import SMALL, half

NAMES = ("ticks", "robots", "links", "events", "visits", "ground")


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run; nobody changes it but for its tables."""
    return fogwatch.run(SMALL, out=tmp_path_factory.mktemp("run") / "small", picture=False).folder


@pytest.mark.parametrize("kind", ["parquet", "csv"])
def test_it_writes_a_file_a_table(
    ran: Path, command: Callable[..., int], capsys: pytest.CaptureFixture[str], tmp_path: Path, kind: str
) -> None:
    assert command("export", ran, "--format", kind, "--out", "some/tables") == 0
    assert capsys.readouterr().out == f"tables: some/tables: {', '.join(f'{name}.{kind}' for name in NAMES)}\n"
    assert {file.name for file in (tmp_path / "some/tables").iterdir()} == {f"{name}.{kind}" for name in NAMES}
    read = pd.read_parquet if kind == "parquet" else pd.read_csv
    ticks = read(tmp_path / "some" / "tables" / f"ticks.{kind}")
    assert ticks.mfow_s.tolist() == fogwatch.load(ran).mfow_s.tolist()


def test_a_run_without_an_end_is_exported_as_far_as_it_goes(
    ran: Path, command: Callable[..., int], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    folder = half(ran, tmp_path / "half")
    assert command("export", folder) == 0
    assert "was cut off" in capsys.readouterr().err
    ticks = pd.read_parquet(folder / "tables" / "ticks.parquet")
    whole = fogwatch.load(ran).ticks.to_pandas()
    assert 0 < len(ticks) < len(whole)
    pd.testing.assert_frame_equal(ticks, whole[: len(ticks)])


def test_bad_arguments_are_named(
    ran: Path, command: Callable[..., int], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    for arguments, words in (
        ((ran, "--format", "xlsx"), "--format xlsx: known are parquet, csv"),
        ((ran, "--out", "file"), "--out file: is a file; name a folder"),
        (("nothing",), "nothing: no such folder; name the folder of a run"),
    ):
        assert command("export", *arguments) == 2
        assert words in capsys.readouterr().err


def test_tables_do_not_follow_a_link_out_of_the_folder(
    ran: Path, command: Callable[..., int], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    folder = half(ran, tmp_path / "half")
    (tmp_path / "elsewhere").mkdir()
    (folder / "tables").symlink_to(tmp_path / "elsewhere")
    assert command("export", folder) == 2
    assert "is a link that leads out of the run's folder; name a folder with --out" in capsys.readouterr().err
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
    command = [sys.executable, "-c", program, str(ran), "--out", str(tmp_path / "tables")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, "COLUMNS": "200"})
    assert done.returncode == 130, done.stderr
    assert "Traceback" not in done.stderr
    assert not list((tmp_path / "tables").iterdir())
