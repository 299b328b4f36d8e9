"""A run's tables from the command line: whole files or none, of whole runs and of killed ones."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import fogwatch
from tests.fogwatch.commands.test_recording_commands import SMALL
from tests.fogwatch.conftest import Refused, Shell, cut_off

NAMES = ("ticks", "robots", "links", "events", "visits", "ground")


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run; nobody changes it but for its tables."""
    return fogwatch.run(SMALL, out=tmp_path_factory.mktemp("run") / "small", picture=False).folder


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


def test_bad_arguments_are_named(ran: Path, refused: Refused, tmp_path: Path) -> None:
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
from monitor.tables import files
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
