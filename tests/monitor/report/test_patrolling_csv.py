"""The files of patrolling_sim's monitor, from visits that are written down here."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from monitor.report import patrolling_csv
from patrol.measures.nodes import Visit

VISITS = [
    Visit(10.0, 2, 4, 10.0, True, 0),
    Visit(100.04, 1, 4, 90.0, False, 1),
    Visit(900.0, 2, 4, 800.0, False, 2),
    Visit(900.5, 2, 0, 30.26, False, 2),
    Visit(1900.0, 1, 0, 999.5, False, 3),
]


def written(folder: Path, monkeypatch: pytest.MonkeyPatch, ticks: int, ended: str = "completed") -> list[list[str]]:
    """The lines of idleness.csv, timeresults.csv and info.csv of a run with steps of half a second."""
    totals = SimpleNamespace(
        visits=VISITS,
        interfered_s=[100.0, 900.0, 900.1],
        vertices=5,
        intervals=lambda: [[1.0, 2.0], [3.0], [4.0, 5.0, 6.0]],
        tick=lambda _: None,
    )
    monkeypatch.setattr(patrolling_csv, "node_totals", lambda _: totals)
    header = SimpleNamespace(
        terrain=SimpleNamespace(name="hall"),
        robots=[1, 2],
        scenario={"patrol": {"policy": "cr"}},
        started="2026-01-02T03:04:05+00:00",
    )
    run: Any = SimpleNamespace(
        journal=SimpleNamespace(header=header, ticks=[]), ticks=ticks, step=0.5, ended=ended, folder=folder
    )
    files = patrolling_csv.write_csv(run, folder)
    assert [file.name for file in files] == ["idleness.csv", "timeresults.csv", "info.csv"]
    return [file.read_text().splitlines() for file in files]


def test_each_visit_but_a_vertexs_first_has_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert written(tmp_path, monkeypatch, 4000)[0] == [
        "Time;Robot;Node;Idleness;Interferences",
        "100.0;0;4;90.0;1",
        "900.0;1;4;800.0;2",
        "900.5;1;0;30.3;2",
        "1900.0;0;0;999.5;3",
    ]


@pytest.mark.parametrize(("ticks", "ends"), [(4000, ["2000.0"]), (3600, []), (1799, None)])
def test_every_fifteen_minutes_and_at_the_end_the_spread_so_far_has_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ticks: int, ends: list[str] | None
) -> None:
    """Of 90 and 800.0 s the mean is 445 and the deviation 355; with 30.26 s, 306.75 and 349.63."""
    head, *lines = written(tmp_path, monkeypatch, ticks)[1]
    assert head == "Time;Idleness min;Idleness avg;Idleness stddev;Idleness max;Interferences"
    if ends is None:
        assert lines == ["899.5;90.0;90.0;0.0;90.0;1"]
        return
    assert lines[:2] == ["900.0;90.0;445.0;355.0;800.0;2", "1800.0;30.3;306.8;349.6;800.0;3"]
    assert [line.partition(";")[0] for line in lines[2:]] == ends


def test_the_run_has_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of all four the mean is 479.9 s and the deviation 426.2 s; three interferences in 2000 s."""
    (line,) = written(tmp_path, monkeypatch, 4000)[2]
    columns = line.split(";")
    assert columns[:9] == ["hall", "2", "", "0.0", "0.00", "fogwatch", "cr", "", ""]
    assert columns[9:14] == ["2026-01-02T03:04:05+00:00", "2000.0", "", "3", "TIMEOUT"]
    assert columns[14:] == ["30.3", "479.9", "426.2", "999.5", "0.09", "4", "0.8", "1"]
    (line,) = written(tmp_path, monkeypatch, 4000, "stopped")[2]
    assert line.split(";")[13] == "ABORT"


def test_without_visits_all_is_zero(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.monitor.report.test_patrolling_csv.VISITS", VISITS[:1])
    visits, times, info = written(tmp_path, monkeypatch, 10)
    assert len(visits) == 1
    assert times[1:] == ["5.0;0.0;0.0;0.0;0.0;0"]
    assert info[0].split(";")[14:18] == ["0.0"] * 4
