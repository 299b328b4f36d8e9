from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

import fogwatch
from tests.fleets import COARSE
from tests.fogwatch.conftest import Refused, Shell


def full_disk(*_: object) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_replay_as_a_folder_needs_a_new_one_and_serves_nothing(
    shell: Shell, refused: Refused, tmp_path: Path
) -> None:
    small = {**COARSE, "duration": 10, "robots": {"count": 2, "model": "holonomic"}}
    run = fogwatch.run(small, out=tmp_path / "run").folder
    assert "20 frames" in shell("replay", run, "--static", "page").out
    files = ["icon.svg", "index.html", "page.css", "palette.css", "plotly.min.js", "run.js"]
    assert sorted(file.name for file in (tmp_path / "page").iterdir()) == files
    before = (tmp_path / "page" / "run.js").read_bytes()
    assert "page: exists already; name a new or an empty folder" in shell("replay", run, "--static", "page").err
    assert (tmp_path / "page" / "run.js").read_bytes() == before
    assert "20 and 20 frames" in shell("replay", run, run, "--static", "pair").out
    assert sorted(file.name for file in (tmp_path / "pair" / "second").iterdir()) == files
    assert "replay: 3 runs were named; name one, or two" in refused("replay", run, run, run)
    refused("replay", run, run, tmp_path, "--static", "other")
    assert f"{tmp_path}: holds no file journal" in refused("replay", run, tmp_path)
    assert "--static other: serves nothing; leave out" in refused("replay", run, "--static", "other", "--browser")
    assert "--token" in refused("replay", run, "--static", "other", "--token", "t" * 32)
    assert not (tmp_path / "other").exists()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Path, "rename", full_disk)
        shown = shell("replay", run, "--static", "other")
    assert shown.code == 2
    assert "other: cannot be written (No space left on device); choose another folder" in shown.err
    assert list((tmp_path / "other").iterdir()) == []
