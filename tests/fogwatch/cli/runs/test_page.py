from __future__ import annotations

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
    assert command("replay", run, "--static", "other", "--browser") == 2
    assert "--static other: serves nothing; leave out" in capsys.readouterr().err
    assert command("replay", run, "--static", "other", "--token", "t" * 32) == 2
    assert "--token" in capsys.readouterr().err
    assert not (tmp_path / "other").exists()
