from __future__ import annotations

import errno
import os
from collections.abc import Callable
from pathlib import Path

import pytest

import fogwatch

SMALL = {
    "name": "small",
    "terrain": {"builtin": "open"},
    "point": 1.0,
    "duration": 10,
    "robots": {"count": 2, "model": "holonomic"},
}


def full_disk(*_: object) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_replay_as_a_folder_needs_a_new_one_and_serves_nothing(
    command: Callable[..., int], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    run = fogwatch.run(SMALL, out=tmp_path / "run").folder
    assert command("replay", run, "--static", "page") == 0
    assert "20 frames" in capsys.readouterr().out
    files = ["icon.svg", "index.html", "page.css", "palette.css", "plotly.min.js", "run.js"]
    assert sorted(file.name for file in (tmp_path / "page").iterdir()) == files
    before = (tmp_path / "page" / "run.js").read_bytes()
    assert command("replay", run, "--static", "page") == 2
    assert "page: exists already; name a new or an empty folder" in capsys.readouterr().err
    assert (tmp_path / "page" / "run.js").read_bytes() == before
    assert command("replay", run, run, "--static", "pair") == 0
    assert "20 and 20 frames" in capsys.readouterr().out
    assert sorted(file.name for file in (tmp_path / "pair" / "second").iterdir()) == files
    assert command("replay", run, run, run) == 2
    assert "replay: 3 runs were named; name one, or two" in capsys.readouterr().err
    assert command("replay", run, run, tmp_path, "--static", "other") == 2
    assert command("replay", run, tmp_path) == 2
    assert f"{tmp_path}: holds no file journal" in capsys.readouterr().err
    assert command("replay", run, "--static", "other", "--browser") == 2
    assert "--static other: serves nothing; leave out" in capsys.readouterr().err
    assert command("replay", run, "--static", "other", "--token", "t" * 32) == 2
    assert "--token" in capsys.readouterr().err
    assert not (tmp_path / "other").exists()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Path, "rename", full_disk)
        assert command("replay", run, "--static", "other") == 2
    assert "other: cannot be written (No space left on device); choose another folder" in capsys.readouterr().err
    assert list((tmp_path / "other").iterdir()) == []
