"""Large maps say how long they take, and a map is read once."""

from pathlib import Path

import numpy as np
import pytest

from patrol.maps.load import read_terrain
from runtime.reporting.logs import Format, begin_log
from tests.patrol.maps.test_maps import grey, write_map


def test_a_large_map_says_at_once_how_long_it_takes_and_is_read_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    begin_log("test", Format.TEXT, "info")
    monkeypatch.setattr("patrol.maps.load.LARGE_S", 0.005)  # 1800 points take 0.003 s, 7200 take 0.009 s
    (tmp_path / "copy").mkdir()
    path, copy = (write_map(folder, grey(*[[254] * 60] * 30)) for folder in (tmp_path, tmp_path / "copy"))
    read_terrain(path, 0.1)
    assert capsys.readouterr().err == ""
    terrain = read_terrain(path, 0.05)
    said = capsys.readouterr().err
    assert "60 x 30 pixels make 0 million points of 0.05 m, which takes about 0 s; a larger point is faster" in said
    again = read_terrain(copy, 0.05)
    assert capsys.readouterr().err == ""
    assert (again.source, again.bounds) == (copy, terrain.bounds)
    assert np.array_equal(again.passable, terrain.passable)
    write_map(tmp_path, grey(*[[0] * 30 + [254] * 30] * 30))
    changed = read_terrain(path, 0.05)
    assert not changed.passable[:, :60].any()
    assert changed.passable[:, 60:].all()
